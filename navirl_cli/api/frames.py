"""Results as pandas DataFrames."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from navirl_cli.errors import MissingPackageError

if TYPE_CHECKING:
    from pandas import DataFrame


def frame_of(records: Sequence[Mapping[str, Any]]) -> "DataFrame":
    """Rows as a pandas DataFrame.

    Raises:
        MissingPackageError: pandas is not installed.
    """
    try:
        from pandas import DataFrame
    except ImportError as error:
        raise MissingPackageError("to_frame needs pandas, found none; install it with: pip install pandas") from error
    return DataFrame.from_records([dict(record) for record in records])
