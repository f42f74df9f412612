"""Defines the wording of reports: explanations of metrics, counts and lists of seeds."""

from fowt_env.training.evaluation.metrics import TABLE, better
from fowt_env.training.evaluation.seeds import ranges

DIRECTIONS = {-1: "Less is better.", 0: "Neither direction is better.", 1: "More is better."}


def about_metric(metric):
    """Return sentences on a metric: meaning, unit and the better direction."""
    name, _, unit = metric.partition("_[")
    meaning = TABLE[metric].meaning if metric in TABLE else name.replace("_", " ")
    return f"{meaning[:1].upper()}{meaning[1:]}. Unit: {unit.removesuffix(']')}. {DIRECTIONS[better(metric)]}"


def counted(count, noun):
    """Return a count with its noun: "1 case", "2 cases"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def numbers_text(values):
    """Return whole numbers as ranges: "1 to 3, 7" for 1, 2, 3, 7."""
    texts = (str(a) if a == b else f"{a} to {b}" if b > a + 1 else f"{a}, {b}" for a, b in ranges(values))
    return ", ".join(texts)


def seeds_text(seeds):
    """Return a list of seeds as text: "seed 1", "seeds 1 to 6, 9"."""
    return f"seed{'' if len(seeds) == 1 else 's'} {numbers_text(seeds)}"
