"""What can go wrong before the first frame of a capture.

Lives here: the one exception of this package. Not here: damage inside a capture, which is never an
exception but the text of `Capture.problem`.
"""

from typing import ClassVar

from ds47.spec.raised import Error


class CaptureError(Error):
    """Nothing can be read: no such file, no permission, not a capture, no decompressor.

    `message` is one line for a person: what happened, to which input, what to do about it.
    """

    ours: ClassVar[bool] = False
    """Whether ds47 is to blame, and not the capture."""

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.message = message
