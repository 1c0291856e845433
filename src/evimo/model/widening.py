"""A larger model that answers as a smaller one does, to be trained further (Chen et al., Net2Net, 2016)."""

from collections.abc import Sequence

import torch
from torch import nn

from evimo.errors import BadInput
from evimo.model.backbone import Convolution, DecodingLayer, EvenlyCascaded, Residual
from evimo.model.motion_net import MotionNet
from evimo.model.networks import Model
from evimo.model.presets import Config, ModelConfig


def widened(model: Model, config: Config) -> MotionNet:
    """A model of another shape with the same answers: its further channels are random, and not listened to yet.

    Raises:
        BadInput: the shape has fewer channels somewhere, another depth or number of objects; or one of both is no model
            that looks twice.
    """
    if not isinstance(model, MotionNet) or not isinstance(config, ModelConfig):
        raise BadInput("ecn is not grown, nor grown from", fix="base from small, or small from tiny")
    if model.config.objects != config.objects:
        problem = f"a model of {model.config.objects} objects cannot be widened to one of {config.objects}"
        raise BadInput(problem, fix="a shape with the same number of objects")
    wide = MotionNet(config)
    with torch.no_grad():
        for source, target in zip(_networks(model), _networks(wide), strict=True):
            _widen(source, target)
        for old, new in ((model.first_pass, wide.first_pass), (model.second_pass, wide.second_pass)):
            new.prior.load_state_dict(old.prior.state_dict())
        wide.second_pass.object_prior.copy_(model.second_pass.object_prior)
    return wide


def _networks(model: MotionNet) -> tuple[EvenlyCascaded, ...]:
    first, second = model.first_pass, model.second_pass
    return first.depth_net.network, first.flow_net, second.network


def _widen(source: EvenlyCascaded, target: EvenlyCascaded) -> None:
    """Copy level by level: the low-level stream to the start of the wider one, each growth to the start of its own."""
    places = _places(source, target)
    for old, new in ((source.stem, target.stem), (source.beside, target.beside)):
        _widen_convolution(old, new, range(old.in_channels), places[0])
    for level, (old, new) in enumerate(zip(source.encoder, target.encoder, strict=True)):
        _widen_residual(old, new, places[level], places[level + 1])
    _widen_residual(source.bottom, target.bottom, places[-1], places[-1])
    for number, (old, new) in enumerate(zip(source.decoder, target.decoder, strict=True)):
        below, here = places[-1 - number], places[-2 - number]
        assert isinstance(old, DecodingLayer) and isinstance(new, DecodingLayer)
        _widen_convolution(old.merge, new.merge, below, here)
        _widen_residual(old.modulate, new.modulate, here, here)
    for old, new, inputs in zip(source.heads, target.heads, reversed(places), strict=True):
        assert (
            isinstance(old, nn.Conv2d) and isinstance(new, nn.Conv2d) and old.bias is not None and new.bias is not None
        )
        new.weight.zero_()
        new.weight[:, list(inputs)] = old.weight
        new.bias.copy_(old.bias)


def _places(source: EvenlyCascaded, target: EvenlyCascaded) -> list[list[int]]:
    """For each level: where the channels of the source are among those of the target."""
    of_source, of_target = _widths(source), _widths(target)
    if len(of_source) != len(of_target):
        raise BadInput("only a model of the same depth can be widened", fix="a shape with the same numbers of layers")
    places: list[list[int]] = []
    starts = [0, *of_source], [0, *of_target]
    for level in range(len(of_source)):
        (begin, end), (first, last) = (each[level : level + 2] for each in starts)
        if last - first < end - begin:
            raise BadInput("a wider model has no fewer channels", fix="a larger shape, such as base for small")
        places.append([*(places[-1] if places else []), *range(first, first + end - begin)])
    return places


def _widths(network: EvenlyCascaded) -> list[int]:
    heads = [head for head in network.heads if isinstance(head, nn.Conv2d)]
    return [head.in_channels for head in reversed(heads)]


def _widen_residual(old: nn.Module, new: nn.Module, inputs: Sequence[int], outputs: Sequence[int]) -> None:
    assert isinstance(old, Residual) and isinstance(new, Residual)
    _widen_convolution(old.first, new.first, inputs, outputs)
    _widen_convolution(old.second, new.second, outputs, outputs)
    new.share.copy_(old.share)


def _widen_convolution(old: Convolution, new: Convolution, inputs: Sequence[int], outputs: Sequence[int]) -> None:
    """The old filters, mean 0, among zeros for channels that they do not know: standardised they are what they were."""
    rows, columns = torch.tensor(list(outputs)), torch.tensor(list(inputs))
    filters = torch.zeros(len(rows), *new.weight.shape[1:])
    filters[:, columns] = old.weight - old.weight.mean((1, 2, 3), keepdim=True)
    new.weight[rows] = filters
    new.gain[rows] = old.gain
    assert old.bias is not None and new.bias is not None
    new.bias[rows] = old.bias
