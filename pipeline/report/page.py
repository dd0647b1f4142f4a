"""One self-contained HTML page: tables and pictures, nothing fetched from elsewhere."""

import base64
import html
from collections.abc import Sequence

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { margin-bottom: 0; } h2 { margin-top: 2.2rem; border-bottom: 1px solid #ddd; }
table { border-collapse: collapse; margin: 1rem 0; } th, td { padding: .25rem .8rem; text-align: right; }
th:first-child, td:first-child { text-align: left; } thead th { border-bottom: 2px solid #888; }
tbody tr:nth-child(even) { background: #f6f6f6; } img { max-width: 100%; }
.pictures img { width: 24rem; background: #000; } figure { display: inline-block; margin: .5rem 1rem .5rem 0; }
figcaption { color: #555; font-size: .9rem; } .warning { background: #fff3cd; padding: .5rem 1rem; }
"""


class Page:
    """Collects sections in order; `render` gives the text of the page."""

    def __init__(self, title: str, subtitle: str) -> None:
        self._title = title
        head = f"<h1>{html.escape(title)}</h1><p>{html.escape(subtitle)}</p>"
        self._parts = [head]

    def section(self, title: str, text: str = "") -> None:
        self._parts.append(f"<h2>{html.escape(title)}</h2>")
        if text:
            self.text(text)

    def text(self, text: str) -> None:
        self._parts.append(f"<p>{html.escape(text)}</p>")

    def links(self, links: Sequence[tuple[str, str]]) -> None:
        """Words and the addresses they lead to."""
        each = (f'<a href="{html.escape(address)}">{html.escape(words)}</a>' for words, address in links)
        self._parts.append(f"<p>{' '.join(each)}</p>")

    def warnings(self, warnings: Sequence[str]) -> None:
        self._parts += [f'<p class="warning">{html.escape(text)}</p>' for text in warnings]

    def table(self, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        head = "".join(f"<th>{html.escape(name)}</th>" for name in columns)
        body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
        self._parts.append(f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")

    def picture(self, png: bytes, caption: str) -> None:
        self._parts.append(_figure(png, caption))

    def pictures(self, pngs: Sequence[tuple[bytes, str]]) -> None:
        """Small pictures side by side."""
        self._parts.append('<div class="pictures">' + "".join(_figure(*p) for p in pngs) + "</div>")

    def render(self) -> str:
        return (
            '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"<title>{html.escape(self._title)}</title><style>{_STYLE}</style></head><body>\n"
            + "\n".join(self._parts)
            + "\n</body></html>\n"
        )


def _figure(png: bytes, caption: str) -> str:
    text = html.escape(caption)
    data = base64.b64encode(png).decode("ascii")
    return f'<figure><img alt="{text}" src="data:image/png;base64,{data}"><figcaption>{text}</figcaption></figure>'
