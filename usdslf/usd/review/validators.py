"""validate.py in the UsdValidation framework, for programs that run all validators.

    register_validators() -> None     makes this process know `usdslf.usd.review.validators:LooksAndStrokes`

Other programs find it with schemas/validators on PXR_PLUGINPATH_NAME and usdslf installed: USD imports this
module when the validator is asked for.  A validator that raises would pass in silence: its exception becomes
a finding.
"""

from __future__ import annotations

from typing import Any

from pxr import Plug, Sdf, Usd, UsdValidation

from usdslf.usd.review.validate import Finding, validate
from usdslf.usd.schema import schema_folder

NAME = f"{__name__}:LooksAndStrokes"
_WARNINGS = ("HiddenEdit", "StaleLook", "MovedStroke")


def register_validators() -> None:
    """Makes the registry of this process know the validator; may be called often."""
    registry = UsdValidation.ValidationRegistry()
    folder = schema_folder()
    if registry.HasValidator(NAME) or not folder:
        return
    Plug.Registry().RegisterPlugins(str(folder / "validators"))
    _register()


def find(stage: Usd.Stage, time_range: Any = None) -> list[UsdValidation.ValidationError]:
    """Returns the findings as errors of the framework."""
    try:
        findings = validate(stage, ocio=None)
    except Exception as error:
        where = str(stage.GetRootLayer().identifier)
        findings = [Finding("ValidatorFailed", "/", f"{type(error).__name__}: {error}", where)]
    return [_error(stage, f) for f in findings]


def _error(stage: Usd.Stage, finding: Finding) -> UsdValidation.ValidationError:
    kind = UsdValidation.ValidationErrorType
    path = Sdf.Path(finding.prim) if Sdf.Path.IsValidPathString(finding.prim) else Sdf.Path.absoluteRootPath
    site = UsdValidation.ValidationErrorSite(stage, path)
    severity = kind.Warn if finding.name in _WARNINGS else kind.Error
    return UsdValidation.ValidationError(finding.name, severity, [site], finding.message)


def _register() -> None:
    registry = UsdValidation.ValidationRegistry()
    if registry.HasValidator(NAME):
        return
    if registry.GetValidatorMetadata(NAME):
        registry.RegisterPluginStageValidator(NAME, find)
        return
    # The registry was filled before the plugin was known.
    metadata = UsdValidation.ValidatorMetadata(name=NAME, keywords=["usdslf"])
    registry.RegisterStageValidator(metadata, find)


_register()
