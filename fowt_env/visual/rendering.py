"""Pictures of a turbine at sea: the side view to scale, its mooring, and strips of live traces.

Everything is drawn from a row of channels {OpenFAST name: value} and the scene, so the same code shows
a running environment and a finished run. Needs pygame: pip install "fowt-env[render]".
"""

import os
from collections import deque
from math import cos, pi, radians, sin
from typing import NamedTuple

import numpy as np

from fowt_env.descriptions.ratings import OVERSPEED, RATED_POWER, RATED_SPEED, ratings
from fowt_env.errors import InputError
from fowt_env.plant.hydro.waves import ramp_factor
from fowt_env.plant.mooring import catenary, line_shape

SIZE = (960, 640)  # pixels of a view
FPS = 30
WINDOW = 60.0  # s of a trace
SIDES = (160, 4000)  # pixels: least and greatest side of a view
SAMPLING = 3  # the side view is drawn this much larger and then averaged
LETTERS = 4  # and so is writing: a font's hinting would misplace small letters
DEPTH_SHIFT = 0.28  # cabinet projection: how far a metre across the wind is shifted, so that the rotor shows
LINE_POINTS = 81
MOST_TENSIONS = 4  # that are written out; of more lines, the least and the largest
LEAST_SEA = 0.55  # rotor radii of water shown below a flat hull
SPLASH = 0.1  # of the draft: what is seen from boats is yellow from there up
WAVE_STEP = 9  # pixels of the enlarged picture between points of the sea surface
LEAST_BLADE = 0.0055, 0.0022  # of the picture's height: least half width of a drawn blade at root and tip
FIRST_WINDOWS = (15.0, 30.0, WINDOW)  # s shown while a run is young

INK, SOFT, FAINT, CARD, PAGE = (
    (30, 38, 50),
    (110, 120, 134),
    (224, 229, 235),
    (255, 255, 255),
    (240, 243, 247),
)
SKY = ((196, 220, 242), (246, 250, 253))
SEA = ((58, 136, 178, 150), (14, 48, 84, 240))
SEABED, CREST, STEEL, YELLOW, WHITE = (
    (122, 104, 82),
    (238, 247, 252),
    (168, 176, 186),
    (240, 190, 40),
    (246, 247, 249),
)
LEVEL = (120, 128, 140)  # of lines across a strip
RGB_COLOURS = ((0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167))
LOOSE, AT_REST, TIGHT = (90, 170, 230), (250, 236, 150), (220, 50, 40)  # of a line, by its tension


class Trace(NamedTuple):
    """A strip of live values."""

    label: str
    channel: str
    unit: str
    form: str
    least: float  # smallest height of the strip
    levels: tuple = ()  # (text, rating) of the lines across it, which are always in sight


TRACES = (
    Trace("wind", "Wind1VelX", "m/s", ".1f", 4.0),
    Trace("rotor speed", "RotSpeed", "rpm", ".2f", 2.0, (("rated", RATED_SPEED), ("trip", OVERSPEED))),
    Trace("blade pitch", "BldPitch1", "deg", ".1f", 4.0),
    Trace("generator torque", "GenTq", "kN m", ".1f", 4.0),
    Trace("power", "GenPwr", "kW", ".0f", 1000.0, (("rated", RATED_POWER),)),
    Trace("platform pitch", "PtfmPitch", "deg", ".2f", 3.0),
)


class Agent(NamedTuple):
    """What an environment's picture shows of its agent."""

    action: tuple  # the last, each in [-1, 1]
    reward: float | None  # of the last step; None before the first


def check_size(name, size):
    """Raises: InputError unless size is None or two whole numbers within SIDES."""
    if size is None:
        return
    sides = tuple(size) if isinstance(size, tuple | list) else ()
    if len(sides) != 2 or not all(isinstance(n, int) and SIDES[0] <= n <= SIDES[1] for n in sides):
        raise InputError(
            f"{name} = {size!r}: must be (width, height), whole numbers in [{SIDES[0]}, {SIDES[1]}]"
        )


def load_pygame():
    """The pygame module. Raises: InputError that names the extra to install."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
    except ImportError as error:
        raise InputError(f'rendering needs pygame ({error}): pip install "fowt-env[render]"') from error
    pygame.font.init()
    return pygame


class Writer:
    """Writing at any size, evenly spaced: set large, then averaged down. Texts are kept, as most repeat."""

    MOST = 600  # texts kept

    def __init__(self, pygame, zoom=1.0):
        self.pygame, self.zoom = pygame, zoom
        self._fonts, self._kept = {}, {}

    def render(self, text, height, colour):
        """Surface with the text, which must not be empty, `height` pixels per line."""
        key = text, height, colour
        if key not in self._kept:
            if not text:
                raise ValueError("no text: pygame cannot scale an empty picture")
            if len(self._kept) >= self.MOST:
                self._kept.clear()
            size = max(6, round(height * self.zoom))
            if size not in self._fonts:
                self._fonts[size] = self.pygame.font.Font(None, LETTERS * size)
            large = self._fonts[size].render(text, True, colour)
            shape = max(1, large.get_width() // LETTERS), max(1, large.get_height() // LETTERS)
            self._kept[key] = self.pygame.transform.smoothscale(large, shape)
        return self._kept[key]


class PlatformPose:
    """Where the platform is: position (3,), m, and rotation (3, 3) from body to inertial axes."""

    def __init__(self, row):
        self.position = np.array([row["PtfmSurge"], row["PtfmSway"], row["PtfmHeave"]])
        roll, pitch, yaw = (radians(row[name]) for name in ("PtfmRoll", "PtfmPitch", "PtfmYaw"))
        cr, sr, cp, sp, cy, sy = cos(roll), sin(roll), cos(pitch), sin(pitch), cos(yaw), sin(yaw)
        self.rotation = np.array(
            [
                [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                [-sp, cp * sr, cp * cr],
            ]
        )

    def inertial(self, points):
        """Inertial coordinates (..., 3) of body-fixed points (..., 3)."""
        return self.position + np.asarray(points, dtype=float) @ self.rotation.T


def mooring_shapes(scene, pose):
    """[((n, 3) inertial points from anchor to fairlead, fairlead tension N)] of the lines of a scene."""
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
    """Elevation of the sea along x at y = 0, summed over all components of the scene's waves."""

    def __init__(self, waves, x):
        self.waves = waves
        self.x = x
        if waves is not None:
            phase = np.outer(x, waves.wave_number * waves.cos_heading) + waves.phase
            self.even, self.odd = waves.amplitude * np.cos(phase), waves.amplitude * np.sin(phase)

    def at(self, time):
        """(len(x),) elevation at a time, m."""
        if self.waves is None:
            return np.zeros(len(self.x))
        turned = self.waves.omega * time
        # einsum: a threaded matrix product of this size loses milliseconds where the machine is busy
        level = np.einsum("xj,j->x", self.even, np.cos(turned))
        level += np.einsum("xj,j->x", self.odd, np.sin(turned))
        return level * ramp_factor(time, self.waves.ramp)


def tension_colour(tension, at_rest):
    """Colour of a line: blue where loose, yellow at its tension at rest, red at one and a half of it."""
    fraction = 2.0 * (tension / at_rest - 1.0) if at_rest > 0.0 else 0.0
    other, fraction = (TIGHT, min(fraction, 1.0)) if fraction > 0.0 else (LOOSE, min(-fraction, 1.0))
    return tuple(round(a + fraction * (b - a)) for a, b in zip(AT_REST, other, strict=True))


class _Part(NamedTuple):
    """A round part of a hull."""

    start: tuple
    end: tuple
    diameter: tuple  # at both


def _outline(points):
    """The corners of the convex hull of points (n, 2), in order."""
    ordered = sorted(map(tuple, points))
    sides = []
    for run in (ordered, ordered[::-1]):
        chain = []
        for x, y in run:
            while len(chain) > 1 and (
                (chain[-1][0] - chain[-2][0]) * (y - chain[-2][1])
                <= (chain[-1][1] - chain[-2][1]) * (x - chain[-2][0])
            ):
                chain.pop()
            chain.append((x, y))
        sides += chain[:-1]
    return sides


class TurbinePanel:
    """The side view of one turbine: x to the right (downwind), z up, to scale."""

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
        """Show this scene from now on: the same turbine, other weather."""
        self.scene = scene
        waves = None if scene.model.hydro is None else scene.model.hydro.waves
        self.surface = Surface(waves, self._pixels / self.scale + self.left)
        rest = PlatformPose(
            dict.fromkeys(("PtfmSurge", "PtfmSway", "PtfmHeave", "PtfmRoll", "PtfmPitch", "PtfmYaw"), 0.0)
        )
        self.tension_at_rest = [tension for _, tension in mooring_shapes(scene, rest)]

    def _gradient(self, colours, end, begin=0):
        """Surface whose colour runs from the first to the second between two heights."""
        pygame = self.pygame
        picture = pygame.Surface(self.inner, pygame.SRCALPHA)
        for y in range(self.inner[1]):
            fraction = min(max((y - begin) / max(1, end - begin), 0.0), 1.0)
            mixed = [round(a + fraction * (b - a)) for a, b in zip(*colours, strict=True)]
            pygame.draw.line(picture, mixed, (0, y), (self.inner[0], y))
        return picture

    def pixels(self, points):
        """(n, 2) pixels, of the enlarged picture, of inertial points (n, 3)."""
        points = np.atleast_2d(points)
        across = (points[:, 0] + DEPTH_SHIFT * points[:, 1] - self.left) * self.scale
        return np.column_stack([across, (self.top - points[:, 2]) * self.scale])

    def draw(self, row, label=None, colour=None, speed=None):
        """The picture of a row of channels, at its final size, with `label`, its `colour` and `speed`."""
        pygame, canvas = self.pygame, self._canvas
        pose = PlatformPose(row)
        canvas.blit(self._sky, (0, 0))
        self._hull(canvas, pose)
        self._sea_over(canvas, row["Time"])
        for number, (points, tension) in enumerate(mooring_shapes(self.scene, pose)):
            tint = tension_colour(tension, self.tension_at_rest[number])
            pygame.draw.lines(canvas, tint, False, self.pixels(points), 2 * SAMPLING)
        self._rotor(canvas, pose, row)
        self._wind(canvas, row)
        picture = pygame.transform.smoothscale(canvas, self.size)
        self._words(picture, row, label, colour, speed)
        return picture

    def _tapered(self, canvas, pose, heights, diameters, colour):
        """A shaded body of revolution about the platform's axis."""
        edges = np.linspace(-1.0, 1.0, 8)
        for low, high in zip(edges[:-1], edges[1:], strict=True):
            light = 1.0 - 0.38 * ((0.5 * (low + high) + 0.35) / 1.35) ** 2
            sides = [(low, heights, diameters), (high, heights[::-1], diameters[::-1])]
            body = [(0.5 * s * d, 0.0, z) for s, zs, ds in sides for z, d in zip(zs, ds, strict=True)]
            shade = [round(c * light) for c in colour]
            self.pygame.draw.polygon(canvas, shade, self.pixels(pose.inertial(body)))

    def _cylinder(self, canvas, pose, ends, diameters, colour):
        """A shaded cylinder or cone of any direction between two body-fixed points."""
        first, second = self.pixels(pose.inertial(ends))
        radii = 0.5 * self.scale * np.asarray(diameters)
        along = second - first
        length = float(np.hypot(*along))
        if length < 0.5 * self.scale * np.linalg.norm(np.subtract(*ends)):  # seen rather from its end
            self.pygame.draw.circle(canvas, [round(0.85 * c) for c in colour], second, max(radii[1], 1.0))
        if length < 1.0:
            return
        across = np.array([-along[1], along[0]]) / length
        edges = np.linspace(-1.0, 1.0, 8)
        for low, high in zip(edges[:-1], edges[1:], strict=True):
            light = 1.0 - 0.38 * ((0.5 * (low + high) + 0.35) / 1.35) ** 2
            corners = [(first, low, 0), (second, low, 1), (second, high, 1), (first, high, 0)]
            body = [point + side * radii[end] * across for point, side, end in corners]
            self.pygame.draw.polygon(canvas, [round(c * light) for c in colour], body)

    def _members(self, canvas, pose, members, draft):
        """The members of a hull, farthest first, yellow from the splash zone up."""
        limit = -SPLASH * draft
        for member in sorted(members, key=lambda member: -(member.start[1] + member.end[1])):
            ends, diameters = np.array([member.start, member.end]), np.array(member.diameter)
            heights = ends[:, 2]
            self._cylinder(canvas, pose, ends, diameters, STEEL if heights.min() < limit else YELLOW)
            if heights.min() < limit < heights.max():
                share = (limit - heights[0]) / (heights[1] - heights[0])
                cut = ends[0] + share * (ends[1] - ends[0])
                wide = diameters[0] + share * (diameters[1] - diameters[0])
                top = int(np.argmax(heights))
                self._cylinder(canvas, pose, np.array([cut, ends[top]]), (wide, diameters[top]), YELLOW)

    def _shapes(self, canvas, pose, shapes, draft):
        """The shapes of a hull as its file gives them for pictures, farthest first."""
        for shape in sorted(shapes, key=lambda shape: -(shape.start[1] + shape.end[1])):
            if shape.diameter is not None:
                self._members(canvas, pose, [_Part(shape.start, shape.end, (shape.diameter,) * 2)], draft)
            else:
                self._beam(canvas, pose, shape, draft)

    def _beam(self, canvas, pose, shape, draft):
        """A straight box: what is seen of it from the side and, of its far half, from above."""
        start, end = np.array(shape.start), np.array(shape.end)
        width, height = shape.section
        along = (end - start) / np.linalg.norm(end - start)
        across = np.array([-along[1], along[0], 0.0]) * 0.5 * width / np.hypot(*along[:2])
        up, limit = np.array([0.0, 0.0, 0.5 * height]), -SPLASH * draft
        middle = 0.5 * (start[2] + end[2])
        layers = [(-1.0, 1.0, STEEL if middle < limit else YELLOW)]
        share = (limit - middle) / (0.5 * height)
        if -1.0 < share < 1.0:
            layers = [(-1.0, share, STEEL), (share, 1.0, YELLOW)]
        for low, high, colour in layers:
            corners = [
                p + side * across + z * up for p in (start, end) for side in (-1, 1) for z in (low, high)
            ]
            seen = self.pixels(pose.inertial(corners))
            self.pygame.draw.polygon(canvas, [round(0.85 * c) for c in colour], _outline(seen))
            near = sorted((-1, 1), key=lambda side: (start + side * across)[1])[0]
            face = [(start, low), (end, low), (end, high), (start, high)]
            front = self.pixels(pose.inertial([p + near * across + z * up for p, z in face]))
            self.pygame.draw.polygon(canvas, colour, front)

    def _box(self, canvas, pose, draft, volume):
        """A box of this draft and displaced volume, of a hull that has no shape in its file."""
        half, deck = 0.5 * np.sqrt(volume / draft), 0.5 * draft
        for low, high, colour in ((-draft, -SPLASH * draft, STEEL), (-SPLASH * draft, deck, YELLOW)):
            corners = [(-half, 0.0, low), (half, 0.0, low), (half, 0.0, high), (-half, 0.0, high)]
            self.pygame.draw.polygon(canvas, colour, self.pixels(pose.inertial(corners)))

    def _hull(self, canvas, pose):
        platform = self.scene.platform
        hull, tower = platform.hull, platform.tower
        if hull is not None:
            z, diameter = np.array(hull.z), np.array(hull.diameter)
            self._tapered(canvas, pose, z, diameter, STEEL)
            splash = np.array([max(z[0], -SPLASH * abs(z[0])), z[-1]])
            self._tapered(canvas, pose, splash, np.interp(splash, z, diameter), YELLOW)
        elif platform.shapes:
            self._shapes(canvas, pose, platform.shapes, platform.draft)
        elif not platform.members:
            self._box(canvas, pose, platform.draft, platform.potential_flow.volume)
        if not platform.shapes:
            self._members(canvas, pose, platform.members, platform.draft)
        heights = np.array([tower.base_height, tower.top_height])
        self._tapered(canvas, pose, heights, np.array([tower.base_diameter, tower.top_diameter]), WHITE)

    def _sea_over(self, canvas, time):
        """Lay the sea over what is under the surface."""
        pygame = self.pygame
        level = (self.top - self.surface.at(time)) * self.scale
        curve = np.column_stack([self._pixels, level])
        self._water.fill((0, 0, 0, 0))
        self._water.blit(self._sea, (0, 0))
        above = [(self._pixels[0], -9), *curve, (self._pixels[-1], -9)]
        pygame.draw.polygon(self._water, (0, 0, 0, 0), above)
        canvas.blit(self._water, (0, 0))
        pygame.draw.lines(canvas, CREST, False, curve, SAMPLING)

    def _rotor(self, canvas, pose, row):
        pygame, rotor = self.pygame, self.scene.turbine.rotor
        radius, hub = rotor.tip_radius, np.array([-rotor.overhang, 0.0, rotor.hub_height])
        around = np.linspace(0.0, 2.0 * pi, 60)
        rim = hub + radius * np.column_stack([np.zeros(60), -np.sin(around), np.cos(around)])
        self._disc.fill((0, 0, 0, 0))
        disc = self.pixels(pose.inertial(rim))
        pygame.draw.polygon(self._disc, (255, 255, 255, 55), disc)
        pygame.draw.lines(self._disc, (90, 110, 135, 90), True, disc, SAMPLING)
        canvas.blit(self._disc, (0, 0))
        half = 0.032 * radius
        corners = [(-0.06, -1), (-0.075, 0.3), (-0.05, 1), (0.16, 1), (0.17, -0.4), (0.15, -1)]
        nacelle = [(x * radius, 0.0, rotor.hub_height + z * half) for x, z in corners]
        # a blade turned away from the viewer lies behind the nacelle; all are upwind of it
        pygame.draw.polygon(canvas, (226, 230, 235), self.pixels(pose.inertial(nacelle)))
        pygame.draw.polygon(canvas, (140, 150, 162), self.pixels(pose.inertial(nacelle)), SAMPLING)
        turn, pitch = radians(row["Azimuth"]), radians(row["BldPitch1"])
        least = self.inner[1] * np.array(LEAST_BLADE)
        for number in range(rotor.blades):
            blade = hub + self._blade(turn + 2.0 * pi * number / rotor.blades, pitch)
            outline = self._thick(self.pixels(pose.inertial(blade)), least)
            pygame.draw.polygon(canvas, (250, 251, 252), outline)
            pygame.draw.lines(canvas, (70, 84, 102), True, outline, SAMPLING - 1)
        centre = self.pixels(pose.inertial(hub))[0]
        pygame.draw.circle(canvas, (200, 206, 214), centre, max(3.0, 0.035 * radius * self.scale))

    def _blade(self, azimuth, pitch):
        """(n, 3) outline of a blade about the hub, body axes: chord and twist of the turbine's own blade."""
        blade = self.scene.turbine.blade
        e_r = np.array([0.0, -sin(azimuth), cos(azimuth)])
        e_t = np.array([0.0, -cos(azimuth), -sin(azimuth)])  # the way the blade moves
        angle = pitch + blade.twist
        chord = np.outer(np.cos(angle), e_t) - np.outer(np.sin(angle), [1.0, 0.0, 0.0])  # to the leading edge
        axis = np.outer(blade.radius, e_r)
        width = blade.chord[:, None] * chord
        tip = self.scene.turbine.rotor.tip_radius * e_r
        return np.vstack([axis + 0.3 * width, tip, (axis - 0.7 * width)[::-1]])

    @staticmethod
    def _thick(outline, least):
        """A blade's outline in pixels, widened where it is narrower than twice `least` (2,), root and tip.

        Seen edge-on a blade to scale is a hair that a small picture loses.
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
        wanted = np.linspace(least[0], least[1], count)
        side = -1.0 if reach.sum() < 0.0 else 1.0  # one for all: a twisted blade would cross itself
        wide = (side * np.maximum(side * reach, wanted))[:, None] * across
        return np.vstack([middle + wide, tip, (middle - wide)[::-1]])

    def _wind(self, canvas, row):
        """An arrow at hub height whose length is the wind speed."""
        pygame, rotor = self.pygame, self.scene.turbine.rotor
        speed = row["Wind1VelX"]
        y = (self.top - rotor.hub_height) * self.scale
        x, unit = 0.035 * self.inner[0], 0.011 * self.inner[0]
        tip, head = x + unit * speed, 0.014 * self.inner[1]
        if abs(speed) > 0.05:
            back = tip - np.sign(speed) * 1.6 * head
            pygame.draw.line(canvas, RGB_COLOURS[0], (x, y), (back, y), 3 * SAMPLING)
            pygame.draw.polygon(canvas, RGB_COLOURS[0], [(tip, y), (back, y - head), (back, y + head)])
        self._wind_text = f"{speed:.1f} m/s", x / SAMPLING, (y + 1.2 * head) / SAMPLING

    def _words(self, picture, row, label, colour, speed):
        """Write time, label and wind onto the finished picture: letters are averaged on their own."""
        text, x, y = self._wind_text
        picture.blit(self._writer.render(text, self._small, RGB_COLOURS[0]), (x, y + 2))
        margin = round(0.02 * self.size[1])
        time = self._writer.render(f"{row['Time']:.1f} s", self._large, INK)
        picture.blit(time, (self.size[0] - time.get_width() - margin, margin))
        if speed is not None:
            words = self._writer.render(f"{speed:.3g} x real time", self._small, SOFT)
            place = self.size[0] - words.get_width() - margin, margin + 1.2 * self._large
            picture.blit(words, place)
        if label:
            name = self._writer.render(label, self._large, INK)
            chip = 0
            if colour is not None:
                chip = round(0.75 * self._large)
                box = self.pygame.Rect(margin, margin + 1, chip, round(0.6 * self._large))
                self.pygame.draw.rect(picture, colour, box, border_radius=2)
                chip += margin // 2
            picture.blit(name, (margin + chip, margin))


class MooringPanel:
    """The whole mooring to scale, down to the seabed, with the tension of each line."""

    def __init__(self, pygame, scene, size):
        self.pygame, self.size = pygame, size
        self._writer = Writer(pygame)
        mooring = scene.model.mooring
        ends = mooring.anchor[:, 0] + DEPTH_SHIFT * mooring.anchor[:, 1]
        self.depth = float(-mooring.anchor[:, 2].min())
        height = scene.turbine.rotor.hub_height
        low, high = min(ends.min(), -height), max(ends.max(), height)
        self.scale = min((size[0] - 24) / (high - low), (size[1] - 62) / (self.depth + 1.1 * height))
        self.middle = 0.5 * (low + high)
        self.level = size[1] - 42 - self.depth * self.scale

    def pixels(self, points):
        """(n, 2) pixels of inertial points (n, 3)."""
        points = np.atleast_2d(points)
        across = 0.5 * self.size[0] + (points[:, 0] + DEPTH_SHIFT * points[:, 1] - self.middle) * self.scale
        return np.column_stack([across, self.level - points[:, 2] * self.scale])

    def draw(self, row, scene, at_rest):
        """The picture of a row of channels."""
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
        shown = ", ".join(texts)
        if len(texts) > MOST_TENSIONS:
            shown = f"{min(texts, key=int)} to {max(texts, key=int)}"
        words = self._writer.render(f"fairlead tension: {shown} kN", 16, SOFT)
        picture.blit(words, (10, self.size[1] - 34))
        tension_key(pygame, picture, self._writer, (10, self.size[1] - 16), self.size[0] - 20)
        return picture


def tension_key(pygame, picture, writer, place, width):
    """Draw what the colours of lines mean: tension over that at rest, from a half to one and a half."""
    (x, y), ends = place, (0.5, 1.5)
    left = writer.render("tension / at rest: 0.5", 15, SOFT)
    right = writer.render("1.5", 15, SOFT)
    picture.blit(left, (x, y))
    begin, end = x + left.get_width() + 6, x + min(width, 300) - right.get_width() - 6
    for column in range(begin, end):
        share = ends[0] + (ends[1] - ends[0]) * (column - begin) / max(1, end - begin - 1)
        pygame.draw.line(picture, tension_colour(share, 1.0), (column, y + 2), (column, y + 8))
    pygame.draw.rect(picture, SOFT, (begin - 1, y + 1, end - begin + 2, 9), 1)
    picture.blit(right, (end + 6, y))


def nice_range(low, high):
    """(low, high, step) that enclose the two on round numbers, with about three steps."""
    rough = (high - low) / 3.0
    power = 10.0 ** np.floor(np.log10(rough))
    step = next(power * m for m in (1.0, 2.0, 2.5, 5.0, 10.0) if power * m >= rough * 0.999)
    return np.floor(low / step + 1e-9) * step, np.ceil(high / step - 1e-9) * step, step


class TracePanel:
    """Strips of the last WINDOW seconds of some channels, of one or several runs, with their scales.

    levels: {rating: value} of the lines across them. span: (begin, end) s that is shown throughout; None:
    what is past, up to WINDOW. limits: {channel: (low, high)} of the values to come, so that scales rest.
    """

    def __init__(self, pygame, size, runs=1, levels=None, span=None, limits=None):
        self.pygame, self.size = pygame, size
        self.levels, self.span, self.limits = levels or {}, span, limits or {}
        self._writer = Writer(pygame, min(1.0, max(0.72, size[0] / 330.0, size[1] / 700.0)))
        self.histories = [deque() for _ in range(runs)]

    def clear(self):
        """Forget what was shown."""
        for history in self.histories:
            history.clear()

    def add(self, rows):
        """Take in one row of channels per run; a time that runs backwards starts the traces anew."""
        time = rows[0]["Time"]
        if self.histories[0] and time < self.histories[0][-1][0]:
            self.clear()
        for history, row in zip(self.histories, rows, strict=True):
            if history and row["Time"] == history[-1][0]:
                history.pop()
            history.append((row["Time"], *(row[trace.channel] for trace in TRACES)))
            while self.span is None and history[0][0] < row["Time"] - WINDOW:
                history.popleft()

    def _times(self, data):
        """(begin, end) of the time axis."""
        if self.span is not None:
            return self.span
        first, last = data[0][0, 0], data[0][-1, 0]
        window = next((w for w in FIRST_WINDOWS if last - first <= w), WINDOW)
        return max(first, last - window), max(first, last - window) + window

    def scale(self, trace, values):
        """(low, high, step) of a strip: encloses its values, its levels and its limits, on round numbers."""
        levels = [self.levels[rating] for _, rating in trace.levels if rating in self.levels]
        ends = [*levels, *self.limits.get(trace.channel, ()), values.min(), values.max()]
        low, high = min(ends), max(ends)
        spare = max(0.0, trace.least - (high - low)) / 2.0
        return nice_range(low - spare, high + spare)

    def draw(self):
        """The picture of the traces."""
        pygame, write = self.pygame, self._writer.render
        picture = pygame.Surface(self.size)
        picture.fill(CARD)
        foot = round(16 * self._writer.zoom)
        strip = (self.size[1] - foot) / len(TRACES)
        head = round(20 * self._writer.zoom)
        data = [np.array(history) for history in self.histories]
        begin, end = self._times(data)
        gutter = round(42 * self._writer.zoom)
        for number, trace in enumerate(TRACES):
            top = number * strip
            shown = np.concatenate([history[:, 1 + number] for history in data])
            low, high, step = self.scale(trace, shown)
            box = pygame.Rect(gutter, round(top + head), self.size[0] - gutter - 10, round(strip - head - 7))
            pygame.draw.rect(picture, PAGE, box)

            def height(value, box=box, low=low, high=high):
                return box.bottom - 1 - (box.height - 2) * (value - low) / (high - low)

            ticks = np.arange(low, high + 0.5 * step, step)
            for tick in ticks if box.height > 26 * self._writer.zoom else ticks[[0, -1]]:
                y = round(height(tick))
                pygame.draw.line(picture, FAINT, (box.left, y), (box.right, y))
                text = write(f"{tick:.6g}", 14, SOFT)
                place = min(max(y - text.get_height() // 2, box.top), box.bottom - text.get_height())
                if len(ticks) <= 4 or tick in (ticks[0], ticks[-1]):
                    picture.blit(text, (gutter - text.get_width() - 4, place))
            for _, rating in trace.levels:
                if rating in self.levels:
                    y = round(height(self.levels[rating]))
                    for x in range(box.left, box.right, 8):
                        pygame.draw.line(picture, LEVEL, (x, y), (min(x + 4, box.right), y))
            for index, history in reversed(list(enumerate(data))):
                x = box.left + (box.width - 1) * (history[:, 0] - begin) / (end - begin)
                if len(x) > 1:
                    line = np.column_stack([x, height(history[:, 1 + number])])
                    colour = RGB_COLOURS[index % len(RGB_COLOURS)]
                    pygame.draw.aalines(picture, colour, False, line)
                    pygame.draw.aalines(picture, colour, False, line + (0, 1))
            text = write(f"{trace.label} ({trace.unit})", 16, SOFT)
            picture.blit(text, (10, top + 5))
            label_end = 10 + text.get_width()
            right = self.size[0] - 10
            for index, history in reversed(list(enumerate(data))):
                colour = RGB_COLOURS[index % len(RGB_COLOURS)]
                text = write(format(history[-1, 1 + number], trace.form), 18, colour)
                right -= text.get_width()
                picture.blit(text, (right, top + 3))
                right -= 12
            known = [
                f"{name} {self.levels[rating]:.4g}" for name, rating in trace.levels if rating in self.levels
            ]
            text = write(", ".join(known) or " ", 14, LEVEL)
            if label_end + 8 + text.get_width() <= right:
                picture.blit(text, (label_end + 8, top + 6))
        words = write(f"{begin:.0f} s", 14, SOFT)
        picture.blit(words, (gutter, self.size[1] - foot))
        words = write(f"{end:.0f} s", 14, SOFT)
        picture.blit(words, (self.size[0] - 10 - words.get_width(), self.size[1] - foot))
        return picture


class AgentPanel:
    """The last action, each entry a bar about zero, and the reward of the step."""

    NAMES = {2: ("torque", "blade pitch"), 4: ("torque", "blade 1", "blade 2", "blade 3")}

    def __init__(self, pygame, width):
        self.pygame, self.width = pygame, width
        self._writer = Writer(pygame)

    def draw(self, agent):
        """The picture of an Agent."""
        pygame, write = self.pygame, self._writer.render
        names = self.NAMES.get(len(agent.action), [f"action {n + 1}" for n in range(len(agent.action))])
        picture = pygame.Surface((self.width, 18 * (len(names) + 1) + 10), pygame.SRCALPHA)
        pygame.draw.rect(picture, (*CARD, 225), picture.get_rect(), border_radius=4)
        left, right = 86, self.width - 46
        for number, (name, value) in enumerate(zip(names, agent.action, strict=True)):
            y = 6 + 18 * number
            picture.blit(write(name, 16, SOFT), (8, y + 2))
            pygame.draw.rect(picture, PAGE, (left, y + 2, right - left, 11))
            middle = 0.5 * (left + right)
            tip = middle + 0.5 * (right - left) * min(max(value, -1.0), 1.0)
            bar = pygame.Rect(round(min(middle, tip)), y + 2, max(1, round(abs(tip - middle))), 11)
            pygame.draw.rect(picture, RGB_COLOURS[0], bar)
            pygame.draw.line(picture, SOFT, (middle, y), (middle, y + 14))
            text = write(f"{value:+.2f}", 16, INK)
            picture.blit(text, (self.width - 8 - text.get_width(), y + 2))
        y = 6 + 18 * len(names)
        reward = "-" if agent.reward is None else f"{agent.reward:+.3f}"
        picture.blit(write("reward", 16, SOFT), (8, y + 2))
        text = write(reward, 16, INK)
        picture.blit(text, (self.width - 8 - text.get_width(), y + 2))
        return picture


class View:
    """What a render mode shows: side views of one or several runs beside each other, traces and mooring.

    scenes: one per run; labels: their names, or None. speed: how many times faster than real time it is
    shown; None: not said. span, limits: as for TracePanel. Rows of channels are given to draw().
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
        self.agent = AgentPanel(pygame, min(240, self.right - 20))
        self.canvas = pygame.Surface(size)
        self._window = self._clock = None

    def enter(self, scene):
        """Show this scene in the first panel from now on; the traces start anew."""
        self.panels[0].enter(scene)
        self.traces.clear()

    def draw(self, rows, agent=None):
        """pygame Surface of one row of channels per run, and of the Agent of the first, if there is one."""
        self.traces.add(rows)
        self.canvas.fill(FAINT)
        for number, (panel, x, row, label) in enumerate(
            zip(self.panels, self.places, rows, self.labels, strict=True)
        ):
            last = number == len(self.panels) - 1
            colour = self.colours[number % len(self.colours)]
            self.canvas.blit(panel.draw(row, label, colour, self.speed if last else None), (x, 0))
        self.canvas.blit(self.traces.draw(), (self.right, 0))
        if self.mooring is not None:
            picture = self.mooring.draw(rows[0], self.panels[0].scene, self.panels[0].tension_at_rest)
            self.canvas.blit(picture, (self.right, self.size[1] - self.mooring.size[1]))
        if agent is not None:
            self.canvas.blit(self.agent.draw(agent), (10, 10))
        return self.canvas

    def array(self):
        """(height, width, 3) uint8 copy of what was drawn last."""
        data = self.pygame.image.tobytes(self.canvas, "RGB")
        return np.frombuffer(data, dtype=np.uint8).reshape(self.size[1], self.size[0], 3).copy()

    def show(self, fps):
        """Put what was drawn last into a window, at no more than fps pictures a second.

        Raises: InputError where there is no display.
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
        """Close the window, if there is one."""
        if self._window is not None:
            self.pygame.display.quit()
            self._window = self._clock = None
