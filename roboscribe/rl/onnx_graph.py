"""A skill as an ONNX model, for robots on which no Python runs: attributes in, an action out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from onnx import ModelProto, NodeProto, TensorProto, ValueInfoProto, helper, numpy_helper

from roboscribe.dsl.printer import text
from roboscribe.dsl.rewrite import run_variables
from roboscribe.dsl.syntax import Run
from roboscribe.rl.observation import CLIP, FINE_CLIP, LEAST_LENGTH, NEARBY, PLANAR, TURNED_SCALES, Encoder, Part
from roboscribe.rl.skill import Skill
from roboscribe.world.layout import ROBOT, Attribute
from roboscribe.world.units import in_si

OPSET, IR_VERSION = 17, 8
"""Old enough for every ONNX runtime of the last years."""
ACTION = "action"


@dataclass
class _Graph:
    """Nodes and constants of a graph that is being built; values are named by counting."""

    nodes: list[NodeProto] = field(default_factory=list)
    constants: list[TensorProto] = field(default_factory=list)

    def __call__(self, kind: str, *inputs: str | NDArray[np.generic] | float, **attributes: int) -> str:
        """Add a node; numbers among its inputs become constants. Returns its output's name."""
        names = [each if isinstance(each, str) else self._constant(np.asarray(each)) for each in inputs]
        output = f"{kind.lower()}{len(self.nodes)}"
        node = helper.make_node(kind, names, [output])
        node.attribute.extend(helper.make_attribute(key, value) for key, value in attributes.items())
        self.nodes.append(node)
        return output

    def _constant(self, array: NDArray[np.generic]) -> str:
        name = f"constant{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(array, name))
        return name

    def bounded(self, value: str, most: float) -> str:
        """Clip to ± `most`."""
        return self("Clip", value, -most, most)

    def columns(self, value: str, start: int, stop: int) -> str:
        """Cut columns out."""
        return self("Slice", value, np.array([start]), np.array([stop]), np.array([1]))


def skill_model(skill: Skill, run: Run) -> ModelProto:
    """Return a skill as an ONNX model.

    Args:
        skill: its encoder, its network and the tanh behind it.
        run: the statement that runs it, whose variables name the inputs.

    Returns:
        A model that takes, for R rows, what the skill sees as doubles, each attribute by its name ("mu.position",
        "b.position", "g(b).position"), and returns `action`, (R, A) in (-1, 1). What is put in for `b` is what the
        program has bound. Its documentation is the statement.
    """
    graph = _Graph()
    names = [input_name(part, run_variables(run)) for part in skill.spec.parts]
    encoded = graph("Cast", _encoded(graph, skill, names), to=TensorProto.FLOAT)
    graph.nodes.append(helper.make_node("Tanh", [_network(graph, skill, encoded)], [ACTION]))
    action = helper.make_tensor_value_info(ACTION, TensorProto.DOUBLE, ["rows", len(skill.layers[-1][1])])
    inputs = [_input(skill.encoder, rank, name) for rank, name in enumerate(names)]
    built = helper.make_graph(graph.nodes, skill.name, inputs, [action], graph.constants, doc_string=text(run))
    opset = [helper.make_opsetid("", OPSET)]
    return helper.make_model(built, producer_name="roboscribe", ir_version=IR_VERSION, opset_imports=opset)


def input_name(part: Part, variables: Sequence[str]) -> str:
    """Name a part of an observation as columns of demonstrations are named, with the variable for the object."""
    owner = "mu" if part.slot == ROBOT else variables[part.slot]
    return f"g({owner}).{part.attribute}" if part.goal else f"{owner}.{part.attribute}"


def _attribute(encoder: Encoder, part: Part) -> Attribute:
    kind = encoder.layout.robot if part.slot == ROBOT else encoder.layout.types[encoder.spec.types[part.slot]]
    return next(each for each in kind.described(part.goal) if each.name == part.attribute)


def _input(encoder: Encoder, rank: int, name: str) -> ValueInfoProto:
    """Declare an input, with its components and unit."""
    attribute = _attribute(encoder, encoder.spec.parts[rank])
    about = f"{', '.join(attribute.components)} in {attribute.unit}"
    return helper.make_tensor_value_info(name, TensorProto.DOUBLE, ["rows", attribute.width], about)


def _encoded(graph: _Graph, skill: Skill, names: Sequence[str]) -> str:
    """Do what `Encoder` does, in its order."""
    spec = skill.spec
    differences = [graph("Sub", names[i], names[j]) for i, j in spec.pairs]
    raw = graph("Concat", *(names[rank] for rank in spec.alone), *differences, axis=1)
    units = [in_si(_attribute(skill.encoder, spec.parts[i]).unit) for i, _ in spec.pairs]
    lengths = [graph("Mul", each, unit) for each, unit in zip(differences, units, strict=True)]
    normal = graph("Div", graph("Sub", raw, np.array(spec.mean)), np.array(spec.std))
    coarse, fine = graph.bounded(normal, CLIP), list[str]()
    if lengths:
        joint = graph("Concat", *lengths, axis=1)
        fine = [graph.bounded(graph("Div", joint, scale), FINE_CLIP) for scale in spec.fine]
    if spec.nearby:
        share = _share(graph, skill, lengths)
        count, width = len(spec.mean), sum(_attribute(skill.encoder, spec.parts[i]).width for i, _ in spec.pairs)
        own, differing = graph.columns(coarse, 0, count - width), graph.columns(coarse, count - width, count)
        coarse = graph("Concat", own, graph("Mul", differing, share), axis=1)
        fine = [graph("Mul", each, share) for each in fine]
    return graph("Concat", coarse, *fine, *_turned(graph, skill, lengths), axis=1)


def _share(graph: _Graph, skill: Skill, lengths: Sequence[str]) -> str:
    """Return the share of each difference, in metres, that is seen."""
    shares = []
    for rank, each in enumerate(lengths):
        whole = graph("Add", graph("Mul", each, 0.0), 1.0)
        if rank in skill.spec.nearby:
            left = graph("Clip", graph("Sub", 1.0, graph("Div", _length(graph, each), NEARBY)), 0.0, 1.0)
            whole = graph("Mul", whole, left)
        shares.append(whole)
    return graph("Concat", *shares, axis=1)


def _turned(graph: _Graph, skill: Skill, differences: Sequence[str]) -> list[str]:
    """Return how differences, in metres, lie to each other from above, and the directions along which they are seen."""
    spec = skill.spec
    if not spec.turned:
        return []
    flat = {rank: graph.columns(differences[rank], 0, PLANAR) for pair in spec.turned for rank in pair}
    directions = sorted({along for _, along in spec.turned})
    ahead = {rank: _direction(graph, flat[rank]) for rank in directions}
    parts = [part for rank, along in spec.turned for part in _along_and_across(graph, flat[rank], ahead[along])]
    joint = graph("Concat", *parts, axis=1)
    scaled = [graph.bounded(graph("Div", joint, scale), FINE_CLIP) for scale in TURNED_SCALES]
    return [*scaled, *(ahead[rank] for rank in directions)]


def _direction(graph: _Graph, flat: str) -> str:
    """Divide a difference by its length."""
    return graph("Div", flat, graph("Max", _length(graph, flat), LEAST_LENGTH))


def _length(graph: _Graph, difference: str) -> str:
    return graph("Sqrt", graph("ReduceSum", graph("Mul", difference, difference), np.array([1]), keepdims=1))


def _along_and_across(graph: _Graph, flat: str, ahead: str) -> tuple[str, str]:
    """Return the parts of a difference (x, y) along and across a direction (u, v)."""
    (x, y), (u, v) = ((graph.columns(each, 0, 1), graph.columns(each, 1, 2)) for each in (flat, ahead))
    along = graph("Add", graph("Mul", x, u), graph("Mul", y, v))
    return along, graph("Sub", graph("Mul", x, v), graph("Mul", y, u))


def _network(graph: _Graph, skill: Skill, hidden: str) -> str:
    """Apply the layers in single precision; returns means in double precision."""
    kind = "Relu" if skill.activation == "relu" else "Elu"
    for rank, (weight, bias) in enumerate(skill.layers):
        hidden = graph("Add", graph("MatMul", hidden, np.ascontiguousarray(weight.T)), bias)
        if rank < len(skill.layers) - 1:
            hidden = graph(kind, hidden)
    return graph("Cast", hidden, to=TensorProto.DOUBLE)
