"""The gallery's index: every entry with its pictures, what was inferred, and whether its figure's claim came true."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import jinja2

from usdslf.gallery.records import Entry, Picture, Shown, Step

TEMPLATE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>usdslf: the paper's figures</title>
<meta name="viewport" content="width=device-width">
<style>
:root { color-scheme: dark }
body { font: 15px/1.5 system-ui, sans-serif; background: #1b1c1e; color: #d8d8d6; margin: 2em auto; max-width: 1400px;
  padding: 0 1em }
h1, h2, h3 { font-weight: 600; line-height: 1.2 }
h2 { margin: 2.5em 0 .3em; border-top: 1px solid #3a3b3e; padding-top: 1em }
h3 { margin: 1.2em 0 .4em; font-size: 1em; color: #b9c7d6 }
.figure { color: #8b8d90; font-weight: 400 }
.claim { max-width: 70em }
.row { display: flex; flex-wrap: wrap; gap: 10px }
figure { margin: 0; flex: 1 1 260px; max-width: 448px }
figure img { width: 100%; display: block; border-radius: 3px; background: #000 }
figcaption { color: #8b8d90; font-size: .85em; padding: 2px 0 }
ul.shown { list-style: none; padding: 0; margin: .4em 0 }
.yes::before { content: "\\2713  "; color: #7ccf8a } .no::before { content: "\\2717  "; color: #f08a7a }
.measured { color: #8b8d90 }
.error { color: #f08a7a }
pre { white-space: pre-wrap; background: #141517; padding: .7em; border-radius: 3px; font-size: .85em }
nav a { margin-right: 1em } a { color: #8fb8e8 }
</style></head><body>
<h1>usdslf: the paper's figures</h1>
<nav>{% for p in pages %}<a href="#{{ p.entry.name }}">{{ p.entry.name }}</a>{% endfor %}</nav>
{% for p in pages %}
<section id="{{ p.entry.name }}">
<h2>{{ p.entry.title }} <span class="figure">figure {{ p.entry.figures }}</span></h2>
<p class="claim">{{ p.entry.claim }}</p>
{% if p.error %}<p class="error">This run failed: {{ p.error }}</p>{% endif %}
{% if p.has_begun %}
<ul class="shown">{% for s in p.shown %}
<li class="{{ 'yes' if s.is_true else 'no' }}">{{ s.sentence }}
{% if s.measured %}<span class="measured">({{ s.measured }})</span>{% endif %}</li>{% endfor %}</ul>
{% for step in p.steps %}
<h3>{{ step.title }}</h3>
<div class="row">{% for x in step.pictures %}
<figure><a href="{{ p.entry.name }}/{{ x.file }}"><img src="{{ p.entry.name }}/{{ x.file }}" alt="{{ x.caption }}"
 loading="lazy"></a><figcaption>{{ x.caption }}</figcaption></figure>{% endfor %}</div>
<pre>{{ step.lines | join("\\n") }}</pre>
{% endfor %}
{% if p.extras %}<div class="row">{% for x in p.extras %}
<figure><a href="{{ p.entry.name }}/{{ x.file }}"><img src="{{ p.entry.name }}/{{ x.file }}" alt="{{ x.caption }}"
 loading="lazy"></a><figcaption>{{ x.caption }}</figcaption></figure>{% endfor %}</div>{% endif %}
{% endif %}
</section>
{% endfor %}
</body></html>
"""


@dataclass(frozen=True)
class StepRow:
    """What the index shows of a step."""

    title: str
    pictures: tuple[Picture, ...]
    lines: tuple[str, ...]

    @staticmethod
    def of(step: Step) -> StepRow:
        """Takes over what is shown of a step, and nothing that holds its sessions."""
        return StepRow(step.title, step.pictures, step.lines)


@dataclass(frozen=True)
class Page:
    """An entry on the index: only what is shown, so that its sessions end with its play."""

    entry: Entry
    has_begun: bool = False  # its shot was written
    steps: tuple[StepRow, ...] = ()
    shown: tuple[Shown, ...] = ()
    extras: tuple[Picture, ...] = ()
    seconds: float = 0.0  # of all steps
    folder: Path | None = None  # of the last step
    error: str = ""


def index_page(pages: Sequence[Page]) -> str:
    """Returns the index as HTML; links are relative to the folder of the entries' folders."""
    template = jinja2.Environment(autoescape=True, trim_blocks=True).from_string(TEMPLATE)
    return template.render(pages=pages)
