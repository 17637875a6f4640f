"""The files of `config` that come with the package."""

from __future__ import annotations

from pathlib import Path


def shipped_files(folder: str) -> dict[str, Path]:
    """The YAML files of a folder of `config` by name: installed, or in the source tree."""
    package = Path(__file__).resolve().parent
    installed = [parent / 'share' / 'lathe_chatter' for parent in package.parents]
    places = [place / 'config' / folder for place in (package.parent, *installed)]
    place = next((place for place in places if place.is_dir()), places[0])
    return {file.stem: file for file in sorted(place.glob('*.yaml'))}
