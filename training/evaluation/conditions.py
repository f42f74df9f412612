"""Describes the conditions of a load case in words: wind, sea and events."""

from fowt_env.descriptions.checks import is_number
from fowt_env.descriptions.sea_state import SeaState, sea_state_of, sea_states

STILL = "still water"
UNITS = {"speed": "m/s", "every": "s", "direction": "deg", "recurrence": "years"}


def wind_text(wind):
    """Describe a wind of build_scene in words: "ntm 18 m/s, class B", "steady 8 m/s", "no wind"."""
    if wind is None:
        return "no wind"
    if is_number(wind):
        return f"steady {wind:g} m/s"
    if not isinstance(wind, dict):
        return str(wind)
    parts = [str(wind.get("kind", "steady"))]
    if "speed" in wind and is_number(wind["speed"]):
        parts[0] += f" {wind['speed']:g} m/s"
    for key, value in wind.items():
        if key in ("kind", "start", "dt") or (key == "speed" and is_number(value)):
            continue
        if isinstance(value, list | tuple) and all(map(is_number, value)):
            text = f"{min(value):g} to {max(value):g}"
        else:
            text = f"{value:g}" if is_number(value) else str(value)
        parts.append(f"{key.replace('_', ' ')} {text} {UNITS.get(key, '')}".rstrip())
    return ", ".join(parts)


def sea_text(sea):
    """Describe a sea of build_scene in words: "JONSWAP Hs 1.86 m, Tp 7.94 s", "regular H 3 m, T 5 s"."""
    if sea is None:
        return STILL
    if isinstance(sea, str) and sea not in sea_states():
        return sea  # the path of a file
    state = sea if isinstance(sea, SeaState) else sea_state_of(sea)
    if state.height == 0.0:
        return STILL
    if state.kind == "regular":
        return f"regular H {state.H:g} m, T {state.T:g} s"
    if state.kind == "components":
        return f"{len(state.omega)} components, up to {state.height:g} m"
    kind = {"jonswap": "JONSWAP", "pierson_moskowitz": "Pierson-Moskowitz"}[state.kind]
    return f"{kind} Hs {state.Hs:.4g} m, Tp {state.Tp:.4g} s"


def described_texts(about):
    """Return (description of wind and events, description of the sea) of a case of cases.described."""
    parts = [wind_text(about["wind"])]
    if about["parked"]:
        parts.append("parked")
    if about["fault"] is not None:
        parts.append(f"{about['fault']['kind'].replace('_', ' ')} at {about['fault']['time']:g} s")
    parts += [f"{key.replace('_', ' ')} {value:g}" for key, value in (about["shift"] or {}).items()]
    return "; ".join(parts), sea_text(about["sea"])
