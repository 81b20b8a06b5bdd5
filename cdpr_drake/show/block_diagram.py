"""The block diagram of a Drake diagram, drawn as control engineers draw a loop.

Drake's own drawing shows every port of every nested block. This one shows one level: each block
with those of its ports that are in use and their sizes, the forward path from left to right, what
feeds back below it and from right to left.
"""

from __future__ import annotations

import html
import os
import shutil
import subprocess
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path

from pydrake.systems.framework import (
    Diagram,
    InputPort,
    InputPortIndex,
    OutputPort,
    OutputPortIndex,
    PortDataType,
    System,
)

from cdpr_drake.errors import CdprError

INPUT = "input: "
"""Prefix that tells an input of the diagram from a block."""


class GraphvizError(CdprError, RuntimeError):
    """Graphviz' `dot` is not installed, or cannot draw."""


@dataclass
class _Block:
    """A block: its class, of its ports in use the labels by index, and which are outputs of all."""

    name: str
    kind: str
    inputs: dict[int, str] = field(default_factory=dict)
    outputs: dict[int, str] = field(default_factory=dict)
    exported: dict[int, str] = field(default_factory=dict)


@dataclass(frozen=True)
class _Wire:
    """A connection: from a block's output, or an input of the diagram, to a block's input."""

    source: str
    output: int | None
    target: str
    input: int


def block_diagram(diagram: Diagram, path: str | os.PathLike[str]) -> Path:
    """Draw the top level of a diagram and return the path of the picture.

    Args:
        diagram: the diagram, e.g. a control loop.
        path: of the picture; its suffix says the format: .svg, .pdf, .png, or .dot for the text.

    Raises:
        GraphvizError: `dot` is missing, or does not know the format.
        OSError: the file cannot be written.
    """
    file = Path(path)
    text = block_diagram_dot(diagram)
    if file.suffix == ".dot":
        file.write_text(text, encoding="utf-8")
        return file
    dot = shutil.which("dot")
    if dot is None:
        raise GraphvizError(
            f"{file.name}: drawing takes `dot` of graphviz, which is not installed"
            " (apt install graphviz); a name that ends in .dot gives its input"
        )
    options = [f"-T{file.suffix.removeprefix('.')}", "-Gdpi=110", f"-o{file}"]
    run = subprocess.run([dot, *options], input=text, capture_output=True, text=True)
    if run.returncode:
        raise GraphvizError(f"{file.name}: dot: {run.stderr.strip()}")
    return file


def block_diagram_dot(diagram: Diagram) -> str:
    """Return the top level of a diagram in graphviz' language.

    Args:
        diagram: the diagram.
    """
    blocks, wires = _read(diagram)
    backward = _feedback(blocks, wires)
    lines = [
        f"digraph {_quoted(diagram.get_name() or 'diagram')} {{",
        "rankdir=LR; nodesep=0.35; ranksep=0.75; bgcolor=white;",
        'fontname="Helvetica,Arial,sans-serif"; fontsize=11; labeljust=l;',
        f"label=<{_caption(diagram, blocks)}>;",
        'node [shape=plain, fontname="Helvetica,Arial,sans-serif", fontsize=11];',
        'edge [color="#44546A", arrowsize=0.7];',
    ]
    for index in range(diagram.num_input_ports()):
        port = diagram.get_input_port(index)
        node = _quoted(INPUT + port.get_name())
        lines.append(f"{node} [shape=box, style=rounded, height=0.3, label=<{_label(port)}>];")
    for name, block in blocks.items():
        back_in = {w.input for w in wires if w.target == name and w.source in backward}
        back_out = {w.output for w in wires if w.source == name and w.target in backward}
        table = _table(block, name in backward, back_in, back_out)
        lines.append(f"{_quoted(name)} [label=<{table}>];")
    lines += [_edge(wire, backward) for wire in wires]
    return "\n".join([*lines, "}", ""])


def _read(diagram: Diagram) -> tuple[dict[str, _Block], list[_Wire]]:
    """Return the blocks by name and the wires between them; those of the diagram's inputs first."""
    blocks, wires, between = {}, [], []
    for system in diagram.GetSystems():
        kind = type(system).__name__.partition("_𝓣")[0].partition("[")[0]
        blocks[system.get_name()] = _Block(system.get_name(), kind)
    for i in range(diagram.num_input_ports()):
        name = diagram.get_input_port(i).get_name()
        for system, index in diagram.GetInputPortLocators(InputPortIndex(i)):
            wires.append(_Wire(INPUT + name, None, *_input(blocks, system, index)))
    for (target, entered), (source, left) in diagram.connection_map().items():
        between.append(_Wire(*_output(blocks, source, left), *_input(blocks, target, entered)))
    for i in range(diagram.num_output_ports()):
        name, index = _output(blocks, *diagram.get_output_port_locator(OutputPortIndex(i)))
        blocks[name].exported[index] = _label(diagram.get_output_port(i))
    # Dot lays blocks out by the order of the wires, and Drake's map of them has none.
    place = {name: i for i, name in enumerate(blocks)}
    between.sort(key=lambda wire: (place[wire.source], place[wire.target], wire.input))
    return blocks, wires + between


def _input(blocks: dict[str, _Block], system: System, index: InputPortIndex) -> tuple[str, int]:
    port, name = system.get_input_port(index), system.get_name()
    blocks[name].inputs[int(index)] = _label(port)
    return name, int(index)


def _output(blocks: dict[str, _Block], system: System, index: OutputPortIndex) -> tuple[str, int]:
    port, name = system.get_output_port(index), system.get_name()
    blocks[name].outputs[int(index)] = _label(port)
    return name, int(index)


def _label(port: InputPort | OutputPort) -> str:
    """Return a port's name, with the size of a vector."""
    size = f" [{port.size()}]" if port.get_data_type() == PortDataType.kVectorValued else ""
    return html.escape(port.get_name()) + size


def _feedback(blocks: dict[str, _Block], wires: list[_Wire]) -> set[str]:
    """Return the names of the blocks that feed back: drawn below, from right to left.

    They lie on a way from the block that is observed most, the one with the most exported outputs,
    to a block that the diagram's first input enters and that leads there.
    """
    follow: dict[str, set[str]] = {name: set() for name in blocks}
    precede: dict[str, set[str]] = {name: set() for name in blocks}
    for wire in wires:
        if wire.source in blocks:
            follow[wire.source].add(wire.target)
            precede[wire.target].add(wire.source)
    turn = max(blocks, key=lambda name: len(blocks[name].exported))
    entries = {wire.target for wire in wires if wire.source == wires[0].source}
    entries &= _reach(precede, turn, {turn})
    ends = {turn} | entries
    backward = set()
    for entry in entries:
        backward |= _reach(precede, entry, ends) - _reach(follow, entry, ends)
    backward &= _reach(follow, turn, ends)
    sources = {name for name in blocks if not precede[name] and not blocks[name].inputs}
    return backward | {name for name in sources if follow[name] and follow[name] <= backward}


def _reach(neighbours: dict[str, set[str]], start: str, ends: set[str]) -> set[str]:
    """Return what can be reached from a block without passing the ends, which do not count."""
    found: set[str] = set()
    waiting = [start]
    while waiting:
        for name in neighbours[waiting.pop()] - ends - found:
            found.add(name)
            waiting.append(name)
    return found


def _table(block: _Block, backward: bool, last_in: set[int], last_out: set[int | None]) -> str:
    """Return a block's label: its name and class, then inputs and outputs side by side."""
    inputs = [
        _cell(f"in{i}", label)
        for i, label in sorted(block.inputs.items(), key=lambda p: (p[0] in last_in, p[0]))
    ]
    outputs = [
        _cell(f"out{i}", block.exported.get(i, label), i in block.exported)
        for i, label in sorted(block.outputs.items(), key=lambda p: (p[0] in last_out, p[0]))
    ]
    left, right = (outputs, inputs) if backward else (inputs, outputs)
    rows = [
        f'<TR><TD COLSPAN="2" BGCOLOR="{"#F3E6CF" if backward else "#DCE4EE"}">'
        f'<B>{html.escape(block.name)}</B><BR/><FONT POINT-SIZE="9">{block.kind}</FONT></TD></TR>'
    ]
    for west, east in zip_longest(left, right, fillvalue="<TD></TD>"):
        rows.append(f"<TR>{west.format(align='LEFT')}{east.format(align='RIGHT')}</TR>")
    return (
        '<TABLE BORDER="1" CELLBORDER="0" CELLSPACING="0" CELLPADDING="3" COLOR="#44546A">'
        f"{''.join(rows)}</TABLE>"
    )


def _cell(place: str, label: str, bold: bool = False) -> str:
    """Return a port's cell, its alignment still to be filled in."""
    text = label.replace("{", "{{").replace("}", "}}")
    if bold:
        name, bracket, size = text.rpartition(" [")
        text = f"<B>{name}</B>{bracket}{size}" if bracket else f"<B>{text}</B>"
    return f'<TD ALIGN="{{align}}" PORT="{place}">{text}</TD>'


def _edge(wire: _Wire, backward: set[str]) -> str:
    """Return a wire as an edge that points to the right, whichever way the signal goes.

    Dot ranks blocks by the direction in which an edge is written; `dir=back` turns the arrow.
    """
    tail, head = _quoted(wire.source), _quoted(wire.target)
    if wire.output is not None:
        tail += f":out{wire.output}:{'w' if wire.source in backward else 'e'}"
    head += f":in{wire.input}:{'e' if wire.target in backward else 'w'}"
    if wire.source in backward or wire.target in backward:
        return f"{head} -> {tail} [dir=back];"
    return f"{tail} -> {head} [weight={8 if wire.output is not None else 1}];"


def _caption(diagram: Diagram, blocks: dict[str, _Block]) -> str:
    name = html.escape(diagram.get_name() or "diagram")
    parts = [f"<B>{name}</B>", "port [size]"]
    if any(block.exported for block in blocks.values()):
        parts.append("<B>bold</B>: an output of the diagram, by its name there")
    return ", ".join(parts)


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
