"""Putting tables into pages: between `<!-- mark -->` and `<!-- end -->`."""

from pathlib import Path


def put(page: Path, mark: str, text: str) -> None:
    """Replace what stands between the marks."""
    before, _, rest = page.read_text().partition(f"<!-- {mark} -->\n")
    after = rest.partition("<!-- end -->")[2]
    page.write_text(f"{before}<!-- {mark} -->\n{text}\n<!-- end -->{after}")
