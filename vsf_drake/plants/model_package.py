"""`package://vsf_drake/...`: the shipped model files, for Drake's Parser and its model directives."""

from __future__ import annotations

from pydrake.multibody.parsing import Parser

from vsf_drake.resources import resource

PACKAGE = "vsf_drake"


def add_model_package(parser: Parser) -> None:
    """Lets `parser` find package://vsf_drake/vsf_foot.sdf, leg.urdf and foot_under_leg.dmd.yaml; twice does no harm.

    Raises:
        InputError: the parser knows another package of this name, or the files are missing.
    """
    package = resource("models/package.xml")
    packages = parser.package_map()
    if packages.Contains(PACKAGE) and packages.GetPath(PACKAGE) == str(package.parent):
        return
    packages.AddPackageXml(package)
