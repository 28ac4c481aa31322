"""Pages for people: templates filled with rows, in one way for all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import jinja2


def template(package: str, name: str, filters: Mapping[str, Callable[..., Any]]) -> jinja2.Template:
    """Return a template of a package; text from rows is escaped, None is nothing.

    Args:
        package: where the template lies.
        name: its file.
        filters: by the name that the template uses.
    """
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(package, "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: "" if value is None else value,
    )
    environment.filters |= filters
    return environment.get_template(name)
