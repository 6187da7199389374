"""The file: read with positions, checked as a whole, and turned into what the relay is told."""

from syncrelay.config.errors import ConfigError
from syncrelay.config.listen import Listen
from syncrelay.config.load import load, load_text
from syncrelay.config.models import DiagnosticsConfig, NodeConfig, StampField, StampSource, Transport
from syncrelay.config.problems import Problem, Severity, Span
from syncrelay.config.qos import AUTO, QosOverrides, QosPreset
from syncrelay.config.render import render, where
from syncrelay.config.resolved import Config, GroupConfig, TopicConfig

__all__ = [
    "AUTO",
    "Config",
    "ConfigError",
    "DiagnosticsConfig",
    "GroupConfig",
    "Listen",
    "NodeConfig",
    "Problem",
    "QosOverrides",
    "QosPreset",
    "Severity",
    "Span",
    "StampField",
    "StampSource",
    "TopicConfig",
    "Transport",
    "load",
    "load_text",
    "render",
    "where",
]
