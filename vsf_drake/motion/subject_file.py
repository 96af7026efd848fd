"""The person of a file: a subject's own, or that of a trial manifest."""

from __future__ import annotations

from pathlib import Path

import yaml

from vsf_drake.errors import InputError
from vsf_drake.motion.manifest import load_manifest, named_file
from vsf_drake.parameters import Subject
from vsf_drake.schema import load_yaml
from vsf_drake.yaml_file import read_yaml


def load_subject(path: str | Path) -> Subject:
    """Reads subject.yaml, or the subject that a trial manifest names (a file with the key `subject`).

    Raises:
        InputError: a file is missing or not what it should be; see `vsf_drake.schema.load_yaml`.
    """
    path = Path(path)
    if not _names_a_subject(path):
        return load_yaml(path, Subject)
    return load_yaml(named_file(path, "subject", load_manifest(path).subject), Subject)


def _names_a_subject(path: Path) -> bool:
    """Whether the file is a manifest. What cannot be read is left to `load_yaml`, which says why."""
    try:
        node = read_yaml(path)
    except InputError:
        return False
    return isinstance(node, yaml.MappingNode) and any(key.value == "subject" for key, _ in node.value)
