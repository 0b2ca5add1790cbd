"""Follows each link of the built documentation that a page of the repository brings: to a file that is there, and an id in it.

site.py FOLDER: the folder of the crate, as cargo doc writes it. site.py --pictures: writes the pictures of docs/ into docs/site.txt, as
the site has no files of the repository. Python, no packages."""
import base64
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """Ids, and addresses of links and pictures."""

    def __init__(self, path):
        super().__init__()
        self.ids, self.addresses, self.texts = set(), [], []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.ids.add(attributes.get("id"))
        address = attributes.get({"a": "href", "img": "src"}.get(tag))
        if address is not None:
            self.addresses.append(address)

    def handle_data(self, data):
        self.texts += re.findall(r"\]\[[a-z.-]+\]|\]\([^)]*\.md", data)


def fault(path, address, pages):
    """Reason why an address of a page leads nowhere, or None."""
    parts = urlsplit(address)
    if parts.scheme in ("http", "https", "data"):
        return None
    if parts.scheme or parts.netloc:
        return "another scheme"
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if target.suffix in (".md", ".rs"):
        return "a file of the repository"
    if not target.is_file():
        return "no file"
    # Lines of a source are numbered by a script.
    if parts.fragment and "src" not in target.parts:
        if target not in pages:
            pages[target] = Page(target)
        if unquote(parts.fragment) not in pages[target].ids:
            return "no such id"
    return None


SITE = Path(__file__).parent.parent / "docs/site.txt"


def site():
    """The text of docs/site.txt with the pictures as they are."""
    def picture(match):
        data = (SITE.parent / match[1]).read_bytes()
        return f"[{match[1]}]: data:image/svg+xml;base64,{base64.b64encode(data).decode()}"

    return re.sub(r"(?m)^\[([^\]]+\.svg)\]: .*$", picture, SITE.read_text(encoding="utf-8"))


def main(folder):
    if folder == "--pictures":
        SITE.write_text(site(), encoding="utf-8")
        return
    if SITE.read_text(encoding="utf-8") != site():
        sys.exit("a picture has changed: .ci/site.py --pictures writes it into docs/site.txt")
    crate = Path(folder).resolve()
    own = [crate / "index.html", *crate.glob("guide/**/*.html"), *crate.glob("pages/**/*.html")]
    pages = {path: Page(path) for path in own}
    faults, count = [], 0
    for path in own:
        page = pages[path]
        count += len(page.addresses)
        found = [(address, fault(path, address, pages)) for address in page.addresses]
        faults += [f"{path.relative_to(crate)}: {address}: {why}" for address, why in found if why]
        faults += [f"{path.relative_to(crate)}: {text}: no definition" for text in page.texts]
    if faults or not pages or count < len(pages):
        sys.exit("\n".join([f"links of {folder}:", *faults]))
    print(f"site: {count} links of {len(own)} pages work")


main(*sys.argv[1:])
