"""What comes with the package beside its code: the files of `config`, and templates."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def shipped_files(folder: str) -> dict[str, Path]:
    """The YAML files of a folder of `config` by name: installed, or in the source tree."""
    package = Path(__file__).resolve().parent
    installed = [parent / 'share' / 'lathe_chatter' for parent in package.parents]
    places = [place / 'config' / folder for place in (package.parent, *installed)]
    place = next((place for place in places if place.is_dir()), places[0])
    return {file.stem: file for file in sorted(place.glob('*.yaml'))}


def rendered(template: str, **facts: Any) -> str:
    """A template of the package with facts; one that it needs and is not given is an error."""
    from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

    environment = Environment(
        loader=PackageLoader('lathe_chatter', ''),
        autoescape=select_autoescape(['html.j2']),
        undefined=StrictUndefined,
    )
    return environment.get_template(template).render(facts)
