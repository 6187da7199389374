"""The user's file: read with positions, validated, and resolved into the groups that the relay runs."""

from syncrelay.config.export import ExportFeature, ExportSource, LerobotConfig
from syncrelay.config.listen import Listen
from syncrelay.config.load import Config, load, load_text
from syncrelay.config.models import Distance, StampField, StampSource, Tolerance, TransformsConfig
from syncrelay.config.problems import ConfigError, Problem, Severity, Span, render, where
from syncrelay.config.qos import AUTO, QosOverrides, QosPreset
from syncrelay.config.resolved import GroupConfig, TopicConfig
from syncrelay.config.sections import DiagnosticsConfig, NodeConfig, Transport

__all__ = [
    "AUTO",
    "Config",
    "ConfigError",
    "DiagnosticsConfig",
    "Distance",
    "ExportFeature",
    "ExportSource",
    "GroupConfig",
    "LerobotConfig",
    "Listen",
    "NodeConfig",
    "Problem",
    "QosOverrides",
    "QosPreset",
    "Severity",
    "Span",
    "StampField",
    "StampSource",
    "Tolerance",
    "TopicConfig",
    "TransformsConfig",
    "Transport",
    "load",
    "load_text",
    "render",
    "where",
]
