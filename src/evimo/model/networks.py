"""Which network a shape is of: ours, which look twice, or the paper's rival, which looks once."""

from dataclasses import fields
from typing import Any, TypeVar

import torch
from torch import nn

from evimo.model.backbone import EvenlyCascaded
from evimo.model.ecn import Ecn
from evimo.model.motion_net import MotionNet
from evimo.model.presets import Config, EcnConfig, ModelConfig

Model = MotionNet | Ecn
AnyModule = TypeVar("AnyModule", bound=nn.Module)


def network_of(config: Config) -> Model:
    """An untrained network of that shape."""
    return Ecn(config) if isinstance(config, EcnConfig) else MotionNet(config)


def config_of(saved: dict[str, Any]) -> Config:
    """The shape that a file's configuration is; its fields tell of which network.

    Raises:
        TypeError: it is none.
    """
    rival = saved.keys() == {field.name for field in fields(EcnConfig)}
    return EcnConfig(**saved) if rival else ModelConfig(**saved)


def compute_in(model: AnyModule, precision: torch.dtype) -> AnyModule:
    """Let a model compute features in this precision, such as torch.bfloat16; fits and losses stay in float32."""
    for part in model.modules():
        if isinstance(part, EvenlyCascaded):
            part.precision = precision
    return model
