"""Draws a floating wind turbine: side view and mooring to scale, and strips of live time series.

The input is a row of channels {OpenFAST name: value} and the scene, so the same code shows a running
environment and a finished run. Needs pygame: pip install "fowt-env[render]".
"""

import os
from collections import deque
from math import cos, pi, radians, sin
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from fowt_env.descriptions.ratings import OVERSPEED, RATED_POWER, RATED_SPEED, ratings
from fowt_env.display import number_text
from fowt_env.errors import InputError
from fowt_env.plant.hydro.waves import ramp_factor
from fowt_env.plant.mooring import catenary, line_shape

SIZE = (960, 640)  # pixels of a view
WINDOW = 60.0  # s of a trace
SIDES = (160, 4000)  # pixels: smallest and largest side of a view
SAMPLING = 3  # enlargement of the side view before averaging
LETTERS = 4  # enlargement of text before averaging: font hinting would misplace small letters
DEPTH_SHIFT = 0.45  # cabinet projection: shift per metre across the wind, so that the rotor is visible
LINE_POINTS = 81
MOST_TENSIONS = 4  # tensions listed in full; for more lines only minimum and maximum
LEAST_SEA = 0.55  # rotor radii of water shown below a flat hull
SPLASH = 0.1  # of the draft: depth above which the hull is yellow
WAVE_STEP = 9  # pixels of the enlarged picture between points of the sea surface
LEAST_BLADE = 0.009, 0.0035  # of the picture's height: smallest half width of a drawn blade at root and tip
FIRST_WINDOWS = (15.0, 30.0, WINDOW)  # s shown at the start of a run
ANGLES = ("PtfmRoll", "PtfmPitch", "PtfmYaw")
ACTION_NAMES = {2: ("torque", "blade pitch"), 4: ("torque", "blade 1", "blade 2", "blade 3")}
TIPS = ("OoPDefl", "IPDefl")  # of each blade that bends, m
MOTIONS = ("PtfmSurge", "PtfmSway", "PtfmHeave", *ANGLES)

INK, SOFT, FAINT, CARD, PAGE = (30, 38, 50), (110, 120, 134), (224, 229, 235), (255,) * 3, (240, 243, 247)
SKY = ((196, 220, 242), (246, 250, 253))
SEA = ((58, 136, 178, 150), (14, 48, 84, 240))
SEABED, CREST, STEEL = (122, 104, 82), (238, 247, 252), (168, 176, 186)
YELLOW, WHITE = (240, 190, 40), (246, 247, 249)
LEVEL = (120, 128, 140)  # of horizontal lines in a strip
RGB_COLOURS = ((0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167))
LOOSE, AT_REST, TIGHT = (90, 170, 230), (250, 236, 150), (220, 50, 40)  # of a mooring line


class Trace(NamedTuple):
    """Defines a strip of live values."""

    label: str
    channel: str
    unit: str
    form: str
    least: float  # smallest range of the strip, in the unit
    levels: tuple = ()  # (text, rating) of horizontal lines, always inside the range


TRACES = (
    Trace("wind", "Wind1VelX", "m/s", ".1f", 4.0),
    Trace("rotor speed", "RotSpeed", "rpm", ".2f", 2.0, (("rated", RATED_SPEED), ("trip", OVERSPEED))),
    Trace("blade pitch", "BldPitch1", "deg", ".1f", 4.0),
    Trace("generator torque", "GenTq", "kN m", ".1f", 4.0),
    Trace("power", "GenPwr", "kW", ".0f", 1000.0, (("rated", RATED_POWER),)),
    Trace("platform pitch", "PtfmPitch", "deg", ".2f", 3.0),
)


class Agent(NamedTuple):
    """Holds the agent's data in the picture of an environment."""

    action: tuple  # the last action, each entry in [-1, 1]
    reward: float | None  # of the last step; None before the first step


def check_size(name, size):
    """Check that size is None or two whole numbers within SIDES. Raises: InputError."""
    if size is None:
        return
    sides = tuple(size) if isinstance(size, tuple | list) else ()
    if len(sides) != 2 or not all(isinstance(n, int) and SIDES[0] <= n <= SIDES[1] for n in sides):
        raise InputError(
            f"{name} = {size!r}: must be (width, height), whole numbers in [{SIDES[0]}, {SIDES[1]}]"
        )


def load_pygame():
    """Import pygame and return the module. Raises: InputError that names the extra to install."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
    except ImportError as error:
        raise InputError(f'rendering needs pygame ({error}): pip install "fowt-env[render]"') from error
    pygame.font.init()
    return pygame


class Writer:
    """Renders evenly spaced text of any size by enlarging and averaging. Caches rendered texts."""

    MOST = 600  # cached texts

    def __init__(self, pygame, zoom=1.0):
        self.pygame, self.zoom = pygame, zoom
        self._fonts, self._kept = {}, {}

    def render(self, text, height, colour):
        """Return the Surface of a text, which must not be empty, with `height` pixels per line."""
        key = text, height, colour
        if key not in self._kept:
            if len(self._kept) >= self.MOST:
                self._kept.clear()
            size = max(6, round(height * self.zoom))
            if size not in self._fonts:
                self._fonts[size] = self.pygame.font.Font(None, LETTERS * size)
            large = self._fonts[size].render(text, True, colour)
            shape = max(1, large.get_width() // LETTERS), max(1, large.get_height() // LETTERS)
            self._kept[key] = self.pygame.transform.smoothscale(large, shape)
        return self._kept[key]

    def put(self, picture, text, position, height, colour, *, right=False):
        """Draw a text at the (x, y) of its left or right upper corner; return the x of the other corner."""
        words = self.render(text, height, colour)
        width = words.get_width()
        picture.blit(words, (position[0] - width if right else position[0], position[1]))
        return position[0] - width if right else position[0] + width


class PlatformPose:
    """Holds the platform's position (3,), m, and rotation (3, 3) from body to inertial axes."""

    def __init__(self, row):
        self.position = np.array([row[name] for name in MOTIONS[:3]])
        self.rotation = Rotation.from_euler("ZYX", [row[name] for name in ANGLES[::-1]], True).as_matrix()

    def inertial(self, points):
        """Return the inertial coordinates (..., 3) of body-fixed points (..., 3)."""
        return self.position + np.asarray(points, dtype=float) @ self.rotation.T


def mooring_shapes(scene, pose):
    """Return [((n, 3) inertial points from anchor to fairlead, fairlead tension N)] of all mooring lines."""
    mooring = scene.model.mooring
    shapes = []
    for i in range(scene.n_lines):
        anchor, end = mooring.anchor[i], pose.inertial(mooring.fairlead[i])
        across = end[:2] - anchor[:2]
        span = float(np.hypot(*across))
        physics = mooring.length[i], mooring.weight[i], mooring.EA[i], mooring.friction[i]
        line = catenary(span, float(end[2] - anchor[2]), *physics, 0.0)
        plane = line_shape(line.H, line.V, span, *physics, n=LINE_POINTS)
        direction = across / span if span > 0.0 else np.zeros(2)
        points = np.column_stack([plane[:, :1] * direction, plane[:, 1]]) + anchor
        shapes.append((points, line.fairlead_tension))
    return shapes


class Surface:
    """Computes the wave elevation along x at y = 0 from all components of the scene's waves."""

    def __init__(self, waves, x):
        self.waves = waves
        self.x = x
        if waves is not None:
            phase = np.outer(x, waves.wave_number * waves.cos_heading) + waves.phase
            self.even, self.odd = waves.amplitude * np.cos(phase), waves.amplitude * np.sin(phase)

    def at(self, time):
        """Return the elevation (len(x),) at a time, m."""
        if self.waves is None:
            return np.zeros(len(self.x))
        turned = self.waves.omega * time
        # einsum: a threaded matrix product of this size is milliseconds slower on a busy machine
        level = np.einsum("xj,j->x", self.even, np.cos(turned))
        level += np.einsum("xj,j->x", self.odd, np.sin(turned))
        return level * ramp_factor(time, self.waves.ramp)


def tension_colour(tension, at_rest):
    """Return the colour of a line: blue if slack, yellow at the tension at rest, red at 1.5 times that."""
    fraction = 2.0 * (tension / at_rest - 1.0) if at_rest > 0.0 else 0.0
    other, fraction = (TIGHT, min(fraction, 1.0)) if fraction > 0.0 else (LOOSE, min(-fraction, 1.0))
    return _mixed(AT_REST, other, fraction)


def _mixed(colour, other, fraction):
    """Return the colour interpolated towards another by a fraction."""
    return tuple(round(a + fraction * (b - a)) for a, b in zip(colour, other, strict=True))


class _SideView:
    """Projects inertial points to pixels: x to the right, z up, y by DEPTH_SHIFT; left, top in m."""

    left = top = 0.0
    scale = 1.0  # pixels per metre

    def pixels(self, points):
        """Return the pixels (n, 2) of inertial points (n, 3)."""
        points = np.atleast_2d(points)
        across = (points[:, 0] + DEPTH_SHIFT * points[:, 1] - self.left) * self.scale
        return np.column_stack([across, (self.top - points[:, 2]) * self.scale])


def _dark(colour):
    """Return a darker shade of a colour."""
    return [round(0.85 * c) for c in colour]


def solids(platform):
    """Yield (ends (2, 3), two diameters or (width, height), whether round) of a hull, the farthest first.

    The spar, else shapes of the platform file, else members, else a box with the hull's volume and draft.
    """
    hull, draft = platform.hull, platform.draft
    solids = platform.shapes or platform.members
    if hull is not None:
        axis = [(0.0, 0.0, z) for z in hull.z]
        for i in range(len(axis) - 1):
            yield np.array(axis[i : i + 2]), hull.diameter[i : i + 2], True
    elif not solids:
        half = 0.5 * np.sqrt(platform.potential_flow.volume / draft)
        yield np.array([(-half, 0.0, -0.25 * draft), (half, 0.0, -0.25 * draft)]), (0.01, 1.5 * draft), False
    else:
        for solid in sorted(solids, key=lambda solid: -(solid.start[1] + solid.end[1])):
            is_round = solid.diameter is not None
            size = np.broadcast_to(solid.diameter, 2) if is_round else solid.section
            yield np.array([solid.start, solid.end]), size, is_round


class TurbinePanel(_SideView):
    """Draws one turbine to scale, in pixels of the enlarged image before averaging."""

    def __init__(self, pygame, scene, size):
        self.pygame = pygame
        self.size = size
        width, height = self.inner = (SAMPLING * size[0], SAMPLING * size[1])
        platform, turbine = scene.platform, scene.turbine
        radius = turbine.rotor.tip_radius
        top = turbine.rotor.hub_height + 1.16 * radius
        bottom = -max(1.18 * platform.draft, LEAST_SEA * radius)
        self.scale = height / (top - bottom)
        self.left = -0.5 * width / self.scale + 0.12 * radius
        self.top = top
        self._sky = self._gradient(SKY, int(top * self.scale))
        self._sea = self._gradient(SEA, height, int(top * self.scale))
        self._canvas = pygame.Surface(self.inner)
        self._water = pygame.Surface(self.inner, pygame.SRCALPHA)
        self._disc = pygame.Surface(self.inner, pygame.SRCALPHA)
        self._pixels = np.arange(-WAVE_STEP, width + 2 * WAVE_STEP, WAVE_STEP)
        self._writer = Writer(pygame)
        self._small, self._large = max(11, round(0.026 * size[1])), max(13, round(0.034 * size[1]))
        self.enter(scene)

    def enter(self, scene):
        """Change the scene to the same turbine in other weather."""
        self.scene = scene
        waves = None if scene.model.hydro is None else scene.model.hydro.waves
        self.surface = Surface(waves, self._pixels / self.scale + self.left)
        rest = PlatformPose(dict.fromkeys(MOTIONS, 0.0))
        self.tension_at_rest = [tension for _, tension in mooring_shapes(scene, rest)]

    def _gradient(self, colours, end, begin=0):
        """Return a Surface with a colour gradient between two heights."""
        opaque = len(colours[0]) == 3  # copied several times as fast as blended
        picture = self.pygame.Surface(self.inner, 0 if opaque else self.pygame.SRCALPHA)
        for y in range(self.inner[1]):
            fraction = min(max((y - begin) / max(1, end - begin), 0.0), 1.0)
            self.pygame.draw.line(picture, _mixed(*colours, fraction), (0, y), (self.inner[0], y))
        return picture

    def draw(self, row, label=None, colour=None, speed=None):
        """Return the image of a row of channels with `label`, its `colour` and `speed`."""
        pygame, canvas = self.pygame, self._canvas
        pose = PlatformPose(row)
        canvas.blit(self._sky, (0, 0))
        self._hull(canvas, pose)
        self._sea_over(canvas, row["Time"])
        for number, (points, tension) in enumerate(mooring_shapes(self.scene, pose)):
            tint = tension_colour(tension, self.tension_at_rest[number])
            pygame.draw.lines(canvas, tint, False, self.pixels(points), 2 * SAMPLING)
        self._rotor(canvas, pose, row)
        position = self._wind(canvas, row["Wind1VelX"])
        picture = pygame.transform.smoothscale(canvas, self.size)
        self._writer.put(picture, f"{row['Wind1VelX']:.1f} m/s", position, self._small, RGB_COLOURS[0])
        self._words(picture, row, label, colour, speed)
        return picture

    def _polygon(self, canvas, colour, pose, points):
        """Fill a polygon of body-fixed points."""
        self.pygame.draw.polygon(canvas, colour, self.pixels(pose.inertial(points)))

    def _cylinder(self, canvas, pose, ends, diameters, colour):
        """Draw a shaded cylinder or cone between two body-fixed points."""
        first, second = self.pixels(pose.inertial(ends))
        radii = 0.5 * self.scale * np.asarray(diameters)
        along = second - first
        length = float(np.hypot(*along))
        if length < 0.5 * self.scale * np.linalg.norm(np.subtract(*ends)):  # seen along its axis
            self.pygame.draw.circle(canvas, _dark(colour), second, max(radii[1], 1.0))
        if length < 1.0:
            return
        across = np.array([-along[1], along[0]]) / length
        edges = np.linspace(-1.0, 1.0, 8)
        for low, high in zip(edges[:-1], edges[1:], strict=True):
            light = 1.0 - 0.38 * ((0.5 * (low + high) + 0.35) / 1.35) ** 2
            corners = [(first, low, 0), (second, low, 1), (second, high, 1), (first, high, 0)]
            body = [point + side * radii[end] * across for point, side, end in corners]
            self.pygame.draw.polygon(canvas, [round(c * light) for c in colour], body)

    def _member(self, canvas, pose, ends, diameters, limit):
        """Draw a cylinder or cone, yellow above the height `limit`."""
        heights = ends[:, 2]
        self._cylinder(canvas, pose, ends, diameters, STEEL if heights.min() < limit else YELLOW)
        if heights.min() < limit < heights.max():
            fraction = (limit - heights[0]) / (heights[1] - heights[0])
            cut, wide = (pair[0] + fraction * (pair[1] - pair[0]) for pair in (ends, diameters))
            top = int(np.argmax(heights))
            self._cylinder(canvas, pose, np.array([cut, ends[top]]), (wide, diameters[top]), YELLOW)

    def _beam(self, canvas, pose, ends, section, limit):
        """Draw a straight box: outline dark, near side light, yellow above the height `limit`."""
        along, half = ends[1] - ends[0], 0.5 * section[1]
        near = np.array([-along[1], along[0], 0.0]) * 0.5 * section[0] / np.hypot(*along[:2])
        near = near if near[1] < 0.0 else -near
        level = np.clip((limit - ends[:, 2].mean()) / half, -1.0, 1.0)
        for low, high, colour in ((-1.0, level, STEEL), (level, 1.0, YELLOW)):
            if low < high:
                face = near + np.vstack([ends + (0, 0, low * half), ends[::-1] + (0, 0, high * half)])
                seen = self.pixels(pose.inertial(np.vstack([face, face - 2.0 * near])))
                self.pygame.draw.polygon(canvas, _dark(colour), seen[ConvexHull(seen).vertices])
                self._polygon(canvas, colour, pose, face)

    def _hull(self, canvas, pose):
        """Draw hull and tower."""
        platform, tower = self.scene.platform, self.scene.platform.tower
        for ends, size, is_round in solids(platform):
            shape = self._member if is_round else self._beam
            shape(canvas, pose, ends, size, -SPLASH * platform.draft)
        ends = np.array([(0.0, 0.0, tower.base_height), (0.0, 0.0, tower.top_height)])
        self._cylinder(canvas, pose, ends, (tower.base_diameter, tower.top_diameter), WHITE)

    def _sea_over(self, canvas, time):
        """Draw the semi-transparent sea over submerged parts."""
        pygame = self.pygame
        level = (self.top - self.surface.at(time)) * self.scale
        curve = np.column_stack([self._pixels, level])
        crest = min(max(int(level.min()) - 1, 0), self.inner[1])
        below = pygame.Rect(0, crest, self.inner[0], self.inner[1] - crest)
        self._water.fill((0, 0, 0, 0), below)
        self._water.blit(self._sea, below, below)
        above = [(self._pixels[0], -9), *curve, (self._pixels[-1], -9)]
        pygame.draw.polygon(self._water, (0, 0, 0, 0), above)
        canvas.blit(self._water, below, below)
        pygame.draw.lines(canvas, CREST, False, curve, SAMPLING)

    def _rotor(self, canvas, pose, row):
        pygame, rotor = self.pygame, self.scene.turbine.rotor
        radius, hub = rotor.tip_radius, np.array([-rotor.overhang, 0.0, rotor.hub_height])
        around = np.linspace(0.0, 2.0 * pi, 60)
        rim = hub + radius * np.column_stack([np.zeros(60), -np.sin(around), np.cos(around)])
        disc = self.pixels(pose.inertial(rim))
        corner, end = disc.min(axis=0) - 2 * SAMPLING, disc.max(axis=0) + 2 * SAMPLING
        box = pygame.Rect(corner, end - corner).clip(self._disc.get_rect())
        self._disc.fill((0, 0, 0, 0), box)
        pygame.draw.polygon(self._disc, (255, 255, 255, 55), disc)
        pygame.draw.lines(self._disc, (90, 110, 135, 90), True, disc, SAMPLING)
        canvas.blit(self._disc, box, box)
        half = 0.032 * radius
        corners = [(-0.06, -1), (-0.075, 0.3), (-0.05, 1), (0.16, 1), (0.17, -0.4), (0.15, -1)]
        nacelle = [(x * radius, 0.0, rotor.hub_height + z * half) for x, z in corners]
        # draw the nacelle first, because all blades are upwind of the nacelle
        self._polygon(canvas, (226, 230, 235), pose, nacelle)
        pygame.draw.polygon(canvas, (140, 150, 162), self.pixels(pose.inertial(nacelle)), SAMPLING)
        turn, pitch = radians(row["Azimuth"]), radians(row["BldPitch1"])
        least = self.inner[1] * np.array(LEAST_BLADE)
        for number in range(rotor.blades):
            tip = [row.get(f"{name}{number + 1}", 0.0) for name in TIPS]
            blade = hub + self._blade(turn + 2.0 * pi * number / rotor.blades, pitch, tip)
            outline = self._thick(self.pixels(pose.inertial(blade)), least)
            pygame.draw.polygon(canvas, (250, 251, 252), outline)
            pygame.draw.lines(canvas, (70, 84, 102), True, outline, SAMPLING - 1)
        centre = self.pixels(pose.inertial(hub))[0]
        pygame.draw.circle(canvas, (200, 206, 214), centre, max(3.0, 0.035 * radius * self.scale))

    def _blade(self, azimuth, pitch, tip):
        """Return the outline (n, 3) of a blade about the hub in body axes.

        tip: displacement (m) downwind and against the rotation, to which the blade bends as a parabola.
        """
        blade, rotor = self.scene.turbine.blade, self.scene.turbine.rotor
        e_r = np.array([0.0, -sin(azimuth), cos(azimuth)])
        e_t = np.array([0.0, -cos(azimuth), -sin(azimuth)])  # direction of rotation
        angle = pitch + blade.twist
        chord = np.outer(np.cos(angle), e_t) - np.outer(np.sin(angle), [1.0, 0.0, 0.0])  # to the leading edge
        radius = np.append(blade.radius, rotor.tip_radius)
        bent = np.clip((radius - rotor.hub_radius) / (rotor.tip_radius - rotor.hub_radius), 0.0, None) ** 2
        axis = np.outer(radius, e_r) + np.outer(bent, [tip[0], 0.0, 0.0] - tip[1] * e_t)
        axis, end = axis[:-1], axis[-1]
        width = blade.chord[:, None] * chord
        return np.vstack([axis + 0.3 * width, end, (axis - 0.7 * width)[::-1]])

    @staticmethod
    def _thick(outline, least):
        """Return a blade's outline in pixels, widened to at least twice `least` (2,) at root and tip.

        An edge-on blade to scale would be invisible in a small image.
        """
        count = len(outline) // 2
        one, tip, other = outline[:count], outline[count], outline[:count:-1]
        middle, half = 0.5 * (one + other), 0.5 * (one - other)
        along = tip - middle[0]
        length = np.hypot(*along)
        if length < 1.0:
            return outline
        across = np.array([-along[1], along[0]]) / length
        reach = half @ across
        side = -1.0 if reach.sum() < 0.0 else 1.0  # common sign: a twisted outline would cross itself
        wide = (side * np.maximum(side * reach, np.linspace(*least, count)))[:, None] * across
        return np.vstack([middle + wide, tip, (middle - wide)[::-1]])

    def _wind(self, canvas, speed):
        """Draw an arrow at hub height, its length proportional to wind speed; return the text position."""
        x, y = 0.035 * self.inner[0], (self.top - self.scene.turbine.rotor.hub_height) * self.scale
        tip, head = x + 0.011 * self.inner[0] * speed, 0.014 * self.inner[1]
        if abs(speed) > 0.05:
            back = tip - np.sign(speed) * 1.6 * head
            self.pygame.draw.line(canvas, RGB_COLOURS[0], (x, y), (back, y), 3 * SAMPLING)
            corners = [(tip, y), (back, y - head), (back, y + head)]
            self.pygame.draw.polygon(canvas, RGB_COLOURS[0], corners)
        return x / SAMPLING, (y + 1.2 * head) / SAMPLING + 2

    def _words(self, picture, row, label, colour, speed):
        """Write time, speed and label onto the averaged image, because averaging would blur text."""
        put, margin = self._writer.put, round(0.02 * self.size[1])
        right = self.size[0] - margin
        put(picture, f"{row['Time']:.1f} s", (right, margin), self._large, INK, right=True)
        if speed is not None:
            position = right, margin + 1.2 * self._large
            put(picture, f"{speed:.3g} x real time", position, self._small, SOFT, right=True)
        if label:
            left = margin
            if colour is not None:
                chip = round(0.75 * self._large)
                box = self.pygame.Rect(margin, margin + 1, chip, round(0.6 * self._large))
                self.pygame.draw.rect(picture, colour, box, border_radius=2)
                left += chip + margin // 2
            put(picture, label, (left, margin), self._large, INK)


class MooringPanel(_SideView):
    """Draws the mooring to scale, down to the seabed, with the tension of each line."""

    def __init__(self, pygame, scene, size):
        self.pygame, self.size = pygame, size
        self._writer = Writer(pygame)
        mooring = scene.model.mooring
        ends = mooring.anchor[:, 0] + DEPTH_SHIFT * mooring.anchor[:, 1]
        self.depth = float(-mooring.anchor[:, 2].min())
        height = scene.turbine.rotor.hub_height
        low, high = min(ends.min(), -height), max(ends.max(), height)
        self.scale = min((size[0] - 24) / (high - low), (size[1] - 62) / (self.depth + 1.1 * height))
        self.level = size[1] - 42 - self.depth * self.scale
        self.left, self.top = 0.5 * (low + high - size[0] / self.scale), self.level / self.scale

    def draw(self, row, scene, at_rest):
        """Return the image of a row of channels."""
        pygame = self.pygame
        picture = pygame.Surface(self.size)
        picture.fill(CARD)
        pygame.draw.rect(picture, SKY[1], (0, 0, self.size[0], self.level))
        bed = self.level + self.depth * self.scale
        pygame.draw.rect(picture, (20, 62, 100), (0, self.level, self.size[0], bed - self.level))
        pygame.draw.rect(picture, SEABED, (0, bed, self.size[0], 3))
        pose = PlatformPose(row)
        texts = []
        for number, (points, tension) in enumerate(mooring_shapes(scene, pose)):
            colour = tension_colour(tension, at_rest[number])
            pygame.draw.aalines(picture, colour, False, self.pixels(points))
            pygame.draw.aalines(picture, colour, False, self.pixels(points) + (0, 1))
            texts.append(f"{1e-3 * tension:.0f}")
        keel, hub = -scene.platform.draft, scene.turbine.rotor.hub_height
        spar = self.pixels(pose.inertial([(0.0, 0.0, keel), (0.0, 0.0, 0.0), (0.0, 0.0, hub)]))
        pygame.draw.line(picture, YELLOW, spar[0], spar[1], 3)
        pygame.draw.line(picture, SOFT, spar[1], spar[2], 2)
        many = len(texts) > MOST_TENSIONS
        shown = f"{min(texts, key=int)} to {max(texts, key=int)}" if many else ", ".join(texts)
        self._writer.put(picture, f"fairlead tension: {shown} kN", (10, self.size[1] - 34), 16, SOFT)
        tension_key(pygame, picture, self._writer, (10, self.size[1] - 16), self.size[0] - 20)
        return picture


def tension_key(pygame, picture, writer, position, width):
    """Draw the colour scale of mooring lines: tension over tension at rest, from 0.5 to 1.5."""
    x, y = position
    end = x + min(width, 300) - writer.render("1.5", 15, SOFT).get_width() - 6
    begin = writer.put(picture, "tension / at rest: 0.5", position, 15, SOFT) + 6
    for column in range(begin, end):
        relative = 0.5 + (column - begin) / max(1, end - begin - 1)
        pygame.draw.line(picture, tension_colour(relative, 1.0), (column, y + 2), (column, y + 8))
    pygame.draw.rect(picture, SOFT, (begin - 1, y + 1, end - begin + 2, 9), 1)
    writer.put(picture, "1.5", (end + 6, y), 15, SOFT)


def nice_range(low, high):
    """Return round (low, high, step) that enclose a range, with about three steps."""
    rough = (high - low) / 3.0
    power = 10.0 ** np.floor(np.log10(rough))
    step = next(power * m for m in (1.0, 2.0, 2.5, 5.0, 10.0) if power * m >= rough * 0.999)
    return np.floor(low / step + 1e-9) * step, np.ceil(high / step - 1e-9) * step, step


class TracePanel:
    """Draws strips of the last WINDOW seconds of some channels of one or several runs, with scales.

    levels: {rating: value} of horizontal lines. span: (begin, end) s of a fixed time axis; None: the last
    WINDOW s. limits: {channel: (low, high)} of the complete run, which keep the scales constant.
    """

    def __init__(self, pygame, size, runs=1, levels=None, span=None, limits=None):
        self.pygame, self.size = pygame, size
        self.levels, self.span, self.limits = levels or {}, span, limits or {}
        self._writer = Writer(pygame, min(1.0, max(0.72, size[0] / 330.0, size[1] / 700.0)))
        self.histories = [deque() for _ in range(runs)]

    def add(self, rows):
        """Append one row of channels per run, replacing rows of the same or a later time."""
        for history, row in zip(self.histories, rows, strict=True):
            while history and row["Time"] <= history[-1][0]:
                history.pop()
            history.append((row["Time"], *(row[trace.channel] for trace in TRACES)))
            while self.span is None and history[0][0] < row["Time"] - WINDOW:
                history.popleft()

    def _levels(self, trace):
        """Return [(text, value)] of the horizontal lines of a strip."""
        return [(text, self.levels[rating]) for text, rating in trace.levels if rating in self.levels]

    def scale(self, trace, values):
        """Return round (low, high, step) of a strip that include its values, levels and limits."""
        levels = [level for _, level in self._levels(trace)]
        ends = [*levels, *self.limits.get(trace.channel, ()), values.min(), values.max()]
        low, high = min(ends), max(ends)
        spare = max(0.0, trace.least - (high - low)) / 2.0
        return nice_range(low - spare, high + spare)

    def draw(self):
        """Return the image of all strips."""
        picture, zoom = self.pygame.Surface(self.size), self._writer.zoom
        picture.fill(CARD)
        foot, head, gutter = round(16 * zoom), round(20 * zoom), round(42 * zoom)
        height = (self.size[1] - foot) / len(TRACES)
        data = [np.array(history) for history in self.histories]
        first, last = data[0][0, 0], data[0][-1, 0]
        window = next((w for w in FIRST_WINDOWS if last - first <= w), WINDOW)
        begin = max(first, last - window)
        times = self.span or (begin, begin + window)
        for number, trace in enumerate(TRACES):
            top, width = number * height, self.size[0] - gutter - 10
            box = self.pygame.Rect(gutter, round(top + head), width, round(height - head - 7))
            series = [(history[:, 0], history[:, 1 + number]) for history in data]
            self._strip(picture, box, trace, series, times)
            self._caption(picture, top, trace, [values[-1] for _, values in series])
        put, low = self._writer.put, self.size[1] - foot
        put(picture, f"{times[0]:.0f} s", (gutter, low), 14, SOFT)
        put(picture, f"{times[1]:.0f} s", (self.size[0] - 10, low), 14, SOFT, right=True)
        return picture

    def _strip(self, picture, box, trace, series, times):
        """Draw scale, levels and curves of a strip."""
        draw, zoom = self.pygame.draw, self._writer.zoom
        low, high, step = self.scale(trace, np.concatenate([values for _, values in series]))

        def height(value):
            return box.bottom - 1 - (box.height - 2) * (value - low) / (high - low)

        draw.rect(picture, PAGE, box)
        ticks = np.arange(low, high + 0.5 * step, step)
        for tick in ticks if box.height > 26 * zoom else ticks[[0, -1]]:
            y = round(height(tick))
            draw.line(picture, FAINT, (box.left, y), (box.right, y))
            text = f"{tick:.6g}"
            tall = self._writer.render(text, 14, SOFT).get_height()
            position = box.left - 4, min(max(y - tall // 2, box.top), box.bottom - tall)
            if len(ticks) <= 4 or tick in (ticks[0], ticks[-1]):
                self._writer.put(picture, text, position, 14, SOFT, right=True)
        for _, level in self._levels(trace):
            y = round(height(level))
            for x in range(box.left, box.right, 8):
                draw.line(picture, LEVEL, (x, y), (min(x + 4, box.right), y))
        begin, end = times
        for index, (time, values) in reversed(list(enumerate(series))):
            if len(time) > 1:
                x = box.left + (box.width - 1) * (time - begin) / (end - begin)
                line = np.column_stack([x, height(values)])
                for shift in (0, 1):
                    draw.aalines(picture, RGB_COLOURS[index % len(RGB_COLOURS)], False, line + (0, shift))

    def _caption(self, picture, top, trace, last):
        """Write name, levels and last values above a strip."""
        put, right = self._writer.put, self.size[0] - 10
        left = put(picture, f"{trace.label} ({trace.unit})", (10, top + 5), 16, SOFT) + 8
        for index, value in reversed(list(enumerate(last))):
            colour = RGB_COLOURS[index % len(RGB_COLOURS)]
            right = put(picture, format(value, trace.form), (right, top + 3), 18, colour, right=True) - 12
        levels = ", ".join(f"{name} {number_text(level)}" for name, level in self._levels(trace))
        if levels and left + self._writer.render(levels, 14, LEVEL).get_width() <= right:
            put(picture, levels, (left, top + 6), 14, LEVEL)


def agent_picture(pygame, writer, width, agent):
    """Return the image of an Agent: each entry of the action as a bar about zero, and the reward."""
    draw, put = pygame.draw, writer.put
    names = ACTION_NAMES.get(len(agent.action), [f"action {n + 1}" for n in range(len(agent.action))])
    picture = pygame.Surface((width, 18 * (len(names) + 1) + 10), pygame.SRCALPHA)
    draw.rect(picture, (*CARD, 225), picture.get_rect(), border_radius=4)
    left, right = 86, width - 46
    middle = 0.5 * (left + right)
    reward = "-" if agent.reward is None else f"{agent.reward:+.3f}"
    rows = [(name, value, f"{value:+.2f}") for name, value in zip(names, agent.action, strict=True)]
    for number, (name, value, text) in enumerate([*rows, ("reward", None, reward)]):
        y = 6 + 18 * number
        put(picture, name, (8, y + 2), 16, SOFT)
        put(picture, text, (width - 8, y + 2), 16, INK, right=True)
        if value is not None:
            draw.rect(picture, PAGE, (left, y + 2, right - left, 11))
            tip = middle + 0.5 * (right - left) * min(max(value, -1.0), 1.0)
            bar = (round(min(middle, tip)), y + 2, max(1, round(abs(tip - middle))), 11)
            draw.rect(picture, RGB_COLOURS[0], bar)
            draw.line(picture, SOFT, (middle, y), (middle, y + 14))
    return picture


class View:
    """Draws the image of a render mode: side views of one or several runs, traces and mooring.

    scenes: one per run; labels: names of the runs, or None. speed: factor over real time, written into the
    image unless None. span, limits: as for TracePanel.
    """

    def __init__(self, scenes, labels=None, size=SIZE, *, speed=None, span=None, limits=None):
        self.pygame = pygame = load_pygame()
        self.size, self.speed = size, speed
        self.labels = labels or [None] * len(scenes)
        self.colours = RGB_COLOURS if labels else (None,)
        width, height = size
        side = round(0.345 * width) if len(scenes) == 1 else round(0.3 * width)
        each = (width - side) // len(scenes)
        self.panels = [TurbinePanel(pygame, scene, (each - 1, height)) for scene in scenes]
        self.places = [number * each for number in range(len(scenes))]
        self.right = width - side
        moored = scenes[0].model.mooring is not None and len(scenes) == 1
        below = round(0.28 * height) if moored else 0
        self.mooring = MooringPanel(pygame, scenes[0], (side, below)) if moored else None
        levels = ratings(scenes[0].turbine)
        self.traces = TracePanel(pygame, (side, height - below), len(scenes), levels, span, limits)
        self._writer = Writer(pygame)
        self.canvas = pygame.Surface(size)
        self._window = self._clock = None

    def enter(self, scene):
        """Change the scene of the first panel and clear the traces."""
        self.panels[0].enter(scene)
        for history in self.traces.histories:
            history.clear()

    def draw(self, rows, agent=None):
        """Return the pygame Surface of one row of channels per run, and of the Agent of the first run."""
        self.traces.add(rows)
        self.canvas.fill(FAINT)
        shown = zip(self.panels, self.places, rows, self.labels, strict=True)
        for number, (panel, x, row, label) in enumerate(shown):
            speed = self.speed if number == len(self.panels) - 1 else None
            self.canvas.blit(panel.draw(row, label, self.colours[number % len(self.colours)], speed), (x, 0))
        self.canvas.blit(self.traces.draw(), (self.right, 0))
        if self.mooring is not None:
            picture = self.mooring.draw(rows[0], self.panels[0].scene, self.panels[0].tension_at_rest)
            self.canvas.blit(picture, (self.right, self.size[1] - self.mooring.size[1]))
        if agent is not None:
            picture = agent_picture(self.pygame, self._writer, min(240, self.right - 20), agent)
            self.canvas.blit(picture, (10, 10))
        return self.canvas

    def array(self):
        """Return a (height, width, 3) uint8 copy of the last image."""
        data = self.pygame.image.tobytes(self.canvas, "RGB")
        return np.frombuffer(data, dtype=np.uint8).reshape(self.size[1], self.size[0], 3).copy()

    def show(self, fps):
        """Show the last image in a window, with at most fps images per second.

        Raises: InputError without a display.
        """
        pygame = self.pygame
        if self._window is None:
            try:
                pygame.display.init()
                self._window = pygame.display.set_mode(self.size)
            except pygame.error as error:
                raise InputError(
                    f"render_mode = 'human': no display ({error}); use 'rgb_array' or SDL_VIDEODRIVER=dummy"
                ) from None
            pygame.display.set_caption("fowt_env")
            self._clock = pygame.time.Clock()
        self._window.blit(self.canvas, (0, 0))
        pygame.event.pump()
        pygame.display.flip()
        self._clock.tick(fps)

    def close(self):
        """Close the window if one is open."""
        if self._window is not None:
            self.pygame.display.quit()
            self._window = self._clock = None
