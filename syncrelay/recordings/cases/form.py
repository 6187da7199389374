"""What the errors of a test file need to know of its models."""

from typing import Final

from syncrelay.config.translate import Form
from syncrelay.recordings.cases.models import Case, CasesFile, Expectation, InputSource

CASES_FORM: Final = Form(
    CasesFile,
    levels={"the file": CasesFile, "a case": Case, "a case's `expect`": Expectation, "a case's `inputs`": InputSource},
    missing={
        "version": "expected `version: 1`",
        "config": "expected the file that is tested, for example `config: fusion.yaml`",
        "cases": "expected one case or more",
    },
)
