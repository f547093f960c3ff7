"""A network as a small ONNX file: weights of convolutions in 8 bits, arithmetic in single precision.

Each output channel's weights have a scale of their own, and a `DequantizeLinear` that any back end
folds away or runs once over a few thousand numbers.
"""

import numpy as np
import onnx
import torch
from onnx import helper, numpy_helper
from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

# Smaller tensors stay as they are, in numbers.
LEAST = 256


def store(network, example, path, takes, gives, many=False):
    network = fold(network.eval().to(memory_format=torch.contiguous_format))
    shapes = {"dynamic_shapes": [{0: torch.export.Dim("images")}]} if many else {}
    program = torch.onnx.export(
        network, (example,), input_names=[takes], output_names=gives, opset_version=18, dynamo=True, **shapes
    )
    program.optimize()
    model = program.model_proto
    # Where in the sources a node comes from is of no use to whoever runs it.
    for part in [*model.graph.node, *model.graph.value_info, model.graph, model]:
        del part.metadata_props[:]
        part.doc_string = ""
    shrink(model.graph)
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, path)


def fold(network):
    """Every batch normalisation after a convolution, as part of it."""
    for module in network.modules():
        if isinstance(module, nn.Sequential):
            for i in range(len(module) - 1):
                if isinstance(module[i], nn.Conv2d) and isinstance(module[i + 1], nn.BatchNorm2d):
                    module[i], module[i + 1] = fuse_conv_bn_eval(module[i], module[i + 1]), nn.Identity()
    return network


def shrink(graph):
    weights = {node.input[1] for node in graph.node if node.op_type == "Conv"}
    kept, added = [], []
    for tensor in graph.initializer:
        values = numpy_helper.to_array(tensor)
        if tensor.name not in weights or values.size < LEAST:
            kept.append(tensor)
            continue
        axes = tuple(range(1, values.ndim))
        scale = np.maximum(np.abs(values).max(axes), 1e-8).astype(np.float32) / 127
        small = np.round(values / scale.reshape(-1, *[1] * (values.ndim - 1))).astype(np.int8)
        names = [f"{tensor.name}.{part}" for part in ("small", "scale")]
        kept += [numpy_helper.from_array(a, name) for a, name in zip((small, scale), names)]
        added.append(helper.make_node("DequantizeLinear", names, [tensor.name], axis=0))
    nodes = [*added, *graph.node]
    del graph.initializer[:], graph.node[:]
    graph.initializer.extend(kept)
    graph.node.extend(nodes)
