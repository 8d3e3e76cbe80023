"""usdslf cache: what is kept between runs."""

from __future__ import annotations

import click

from usdslf.cli.program import Command


@click.command(cls=Command)
@click.option("--clear", is_flag=True, help="Remove all of it; it is computed again where it is needed.")
@click.option("--size", is_flag=True, help="Its bytes alone.")
def cache(clear: bool, size: bool) -> None:
    """What is kept between runs: its folder, entries and size; with --clear, nothing any more."""
    from usdslf.cache import Cache, cache_folder

    kept = Cache(cache_folder())
    if clear:
        count, before = len(kept.entries()), kept.size()
        gone = kept.clear()
        left = f"; {count - gone} could not be removed" if gone < count else ""
        if not size:
            click.echo(f"{kept.folder}: removed {gone} entries, {_mib(before - kept.size())}{left}")
            return
    if size:
        click.echo(kept.size())
    else:
        limit = f"at most {_mib(kept.limit)} are kept"
        click.echo(f"{kept.folder}: {len(kept.entries())} entries, {_mib(kept.size())}; {limit}")


def _mib(size: int) -> str:
    return f"{size / 2**20:.1f} MiB"
