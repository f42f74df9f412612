"""Implements fowt dataset: data sets of Minari for offline learning."""

from typing import Annotated

from typer import Argument, Option

from fowt_env.training.cli.console import add_group, command, note, progress_bar, wrote
from fowt_env.training.cli.tables import print_table

datasets = add_group("dataset", "Make and check data sets for offline learning (Minari).")


@command(datasets)
def make(
    behaviour: Annotated[str, Argument(help="Who acts: expert, medium, random or faulty.")],
    hours: Annotated[float, Option(help="Hours of operation, in episodes of ten minutes.")] = 1.0,
    dataset_id: Annotated[
        str | None, Option("--id", help="Name in Minari; default: oc3hywind/BEHAVIOUR-v0.")
    ] = None,
):
    """Make a data set of a controller's operation.

    Minari has its folder in ~/.minari, or in MINARI_DATASETS_PATH.

    Examples:
    fowt dataset make medium  # an hour of the PI law
    fowt dataset make expert --hours 500  # model predictive control, about 2 GB
    fowt dataset check oc3hywind/medium-v0

    [bold]Behaviour[/bold]: expert (mpc), medium (pi), random (pi with held random additions), faulty (pi with
    faulty sensors). Weather is that of training seeds. A stopped command continues when it is repeated, and
    more hours extend a set. The card is README.md in the folder of the set.
    """
    from fowt_env.training.rl.dataset import CARD, figures, make_dataset

    with progress_bar("episodes") as update:
        dataset = make_dataset(
            behaviour, hours, dataset_id, progress=lambda done, total: update(done, total, "")
        )
    _print_figures(dataset.spec.dataset_id, figures(dataset))
    wrote(dataset.spec.data_path.parent / CARD)


@command(datasets)
def check(
    dataset_id: Annotated[str, Argument(help="Name in Minari.")],
    replays: Annotated[int, Option(help="Episodes replayed in the environment.")] = 3,
):
    """Check a data set: arrays, seeds, and episodes replayed bit for bit.

    Examples:
    fowt dataset check oc3hywind/expert-v0
    """
    from fowt_env.training.rl.dataset import check_dataset

    with progress_bar("episodes") as update:
        values = check_dataset(dataset_id, replays, lambda done, total: update(done, total, ""))
    _print_figures(dataset_id, values)
    note(f"checked: {values['episodes']} episodes, {min(replays, values['episodes'])} of them replayed")


def _print_figures(dataset_id, values):
    """Print the figures of a data set."""
    print_table(("data set", *values), [(dataset_id, *values.values())])
