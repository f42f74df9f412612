"""Pictures of a turbine at sea: the side view to scale, its mooring, and strips of live traces.

Everything is drawn from a row of channels {OpenFAST name: value} and the scene, so the same code shows
a running environment and a finished run. Needs pygame: pip install "fowt-env[render]".
"""

import os
from collections import deque
from math import cos, pi, radians, sin

import numpy as np

from fowt_env.errors import InputError
from fowt_env.plant.hydro.waves import ramp_factor
from fowt_env.plant.mooring import catenary, line_shape

SIZE = (960, 640)  # pixels of a view
FPS = 30
WINDOW = 60.0  # s of a trace
SAMPLING = 2  # the side view is drawn this much larger and then averaged
DEPTH_SHIFT = 0.28  # cabinet projection: how far a metre across the wind is shifted, so that the rotor shows
LINE_POINTS = 81
MOST_TENSIONS = 4  # that are written out; of more lines, the least and the largest
LEAST_SEA = 0.4  # rotor radii of water shown below a flat hull
SPLASH = 0.1  # of the draft: what is seen from boats is yellow from there up
WAVE_STEP = 10  # pixels of the enlarged picture between points of the sea surface

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
RGB_COLOURS = ((0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167))
LOOSE, AT_REST, TIGHT = (90, 170, 230), (250, 236, 150), (220, 50, 40)  # of a line, by its tension

# label, channel, unit, format, smallest height of the panel
TRACES = (
    ("wind", "Wind1VelX", "m/s", ".1f", 2.0),
    ("rotor speed", "RotSpeed", "rpm", ".2f", 1.0),
    ("blade pitch", "BldPitch1", "deg", ".1f", 2.0),
    ("power", "GenPwr", "kW", ".0f", 500.0),
    ("platform pitch", "PtfmPitch", "deg", ".2f", 1.0),
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
        small, large = round(0.026 * height), round(0.034 * height)
        self._fonts = pygame.font.Font(None, small), pygame.font.Font(None, large)
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

    def draw(self, row, label=None):
        """The picture of a row of channels, at its final size."""
        pygame, canvas = self.pygame, self._canvas
        pose = PlatformPose(row)
        canvas.blit(self._sky, (0, 0))
        self._hull(canvas, pose)
        self._sea_over(canvas, row["Time"])
        for number, (points, tension) in enumerate(mooring_shapes(self.scene, pose)):
            colour = tension_colour(tension, self.tension_at_rest[number])
            pygame.draw.lines(canvas, colour, False, self.pixels(points), 2 * SAMPLING)
        self._rotor(canvas, pose, row)
        self._wind(canvas, row)
        self._words(canvas, row, label)
        return pygame.transform.smoothscale(canvas, self.size)

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
        elif not platform.members:
            self._box(canvas, pose, platform.draft, platform.potential_flow.volume)
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
        for number in range(rotor.blades):
            outline = self.pixels(
                pose.inertial(hub + self._blade(turn + 2.0 * pi * number / rotor.blades, pitch))
            )
            pygame.draw.polygon(canvas, (250, 251, 252), outline)
            pygame.draw.polygon(canvas, (70, 84, 102), outline, SAMPLING)
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
        text = self._fonts[0].render(f"{speed:.1f} m/s", True, RGB_COLOURS[0])
        canvas.blit(text, (x, y + 1.2 * head))

    def _words(self, canvas, row, label):
        time = self._fonts[1].render(f"{row['Time']:.1f} s", True, INK)
        margin = round(0.02 * self.inner[1])
        canvas.blit(time, (self.inner[0] - time.get_width() - margin, margin))
        if label:
            canvas.blit(self._fonts[1].render(label, True, INK), (margin, margin))


class MooringPanel:
    """The whole mooring to scale, down to the seabed, with the tension of each line."""

    def __init__(self, pygame, scene, size):
        self.pygame, self.size = pygame, size
        self._font = pygame.font.Font(None, 17)
        mooring = scene.model.mooring
        ends = mooring.anchor[:, 0] + DEPTH_SHIFT * mooring.anchor[:, 1]
        self.depth = float(-mooring.anchor[:, 2].min())
        height = scene.turbine.rotor.hub_height
        low, high = min(ends.min(), -height), max(ends.max(), height)
        self.scale = min((size[0] - 24) / (high - low), (size[1] - 46) / (self.depth + 1.1 * height))
        self.middle = 0.5 * (low + high)
        self.level = size[1] - 26 - self.depth * self.scale

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
        words = self._font.render(f"fairlead tensions {shown} kN", True, SOFT)
        picture.blit(words, (10, self.size[1] - 18))
        return picture


class TracePanel:
    """Strips of the last WINDOW seconds of some channels, of one or several runs."""

    def __init__(self, pygame, size, runs=1, labels=()):
        self.pygame, self.size = pygame, size
        self.labels = labels
        self._font, self._bold = pygame.font.Font(None, 18), pygame.font.Font(None, 20)
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
            history.append((row["Time"], *(row[channel] for _, channel, *_ in TRACES)))
            while history[0][0] < row["Time"] - WINDOW:
                history.popleft()

    def draw(self):
        """The picture of the traces."""
        pygame = self.pygame
        picture = pygame.Surface(self.size)
        picture.fill(CARD)
        strip = self.size[1] / len(TRACES)
        data = [np.array(history) for history in self.histories]
        end = max(WINDOW, data[0][-1, 0])
        for number, (label, _, unit, form, least) in enumerate(TRACES):
            top = number * strip
            shown = np.concatenate([history[:, 1 + number] for history in data])
            middle, half = 0.5 * (shown.max() + shown.min()), 0.5 * max(float(np.ptp(shown)) * 1.1, least)
            box = pygame.Rect(10, round(top + 24), self.size[0] - 20, round(strip - 32))
            pygame.draw.rect(picture, PAGE, box, border_radius=3)
            for index, history in reversed(list(enumerate(data))):
                x = box.left + box.width * (history[:, 0] - end + WINDOW) / WINDOW
                y = box.bottom - box.height * (history[:, 1 + number] - middle + half) / (2.0 * half)
                if len(x) > 1:
                    line = np.column_stack([x, y])
                    pygame.draw.aalines(picture, RGB_COLOURS[index % len(RGB_COLOURS)], False, line)
                    pygame.draw.aalines(picture, RGB_COLOURS[index % len(RGB_COLOURS)], False, line + (0, 1))
            picture.blit(self._font.render(f"{label} ({unit})", True, SOFT), (10, top + 7))
            right = self.size[0] - 10
            for index, history in reversed(list(enumerate(data))):
                text = self._bold.render(
                    format(history[-1, 1 + number], form), True, RGB_COLOURS[index % len(RGB_COLOURS)]
                )
                right -= text.get_width()
                picture.blit(text, (right, top + 6))
                right -= 12
        return picture


class View:
    """What a render mode shows: side views of one or several runs beside each other, traces and mooring.

    scenes: one per run; labels: their names, or None. Rows of channels are given to draw().
    """

    def __init__(self, scenes, labels=None, size=SIZE):
        self.pygame = pygame = load_pygame()
        self.size = size
        self.labels = labels or [None] * len(scenes)
        width, height = size
        side = round(0.345 * width) if len(scenes) == 1 else round(0.28 * width)
        each = (width - side) // len(scenes)
        self.panels = [TurbinePanel(pygame, scene, (each - 1, height)) for scene in scenes]
        self.places = [number * each for number in range(len(scenes))]
        self.right = width - side
        moored = scenes[0].model.mooring is not None and len(scenes) == 1
        below = round(0.28 * height) if moored else 0
        self.mooring = MooringPanel(pygame, scenes[0], (side, below)) if moored else None
        self.traces = TracePanel(pygame, (side, height - below), len(scenes))
        self.canvas = pygame.Surface(size)
        self._window = self._clock = None

    def enter(self, scene):
        """Show this scene in the first panel from now on; the traces start anew."""
        self.panels[0].enter(scene)
        self.traces.clear()

    def draw(self, rows):
        """pygame Surface of one row of channels per run."""
        self.traces.add(rows)
        self.canvas.fill(FAINT)
        for panel, x, row, label in zip(self.panels, self.places, rows, self.labels, strict=True):
            self.canvas.blit(panel.draw(row, label), (x, 0))
        self.canvas.blit(self.traces.draw(), (self.right, 0))
        if self.mooring is not None:
            picture = self.mooring.draw(rows[0], self.panels[0].scene, self.panels[0].tension_at_rest)
            self.canvas.blit(picture, (self.right, self.size[1] - self.mooring.size[1]))
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
