"""Numbers that stand together have the same digits."""

from math import inf, nan

import pytest

from navirl_cli.documents.numbers import evenly


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([1.11, 0.8753, 1.452], ["1.11", "0.88", "1.45"]),
        ([-53.47, -57.4, -49.8], ["-53.5", "-57.4", "-49.8"]),
        ([-6.67, -10.0, -3.338], ["-6.67", "-10.00", "-3.34"]),
        ([0.00476, 0.00324, 0.00698], ["0.00476", "0.00324", "0.00698"]),
        ([9.996, 2.0], ["10.0", "2.0"]),
        ([1234.0, 0.2], ["1234", "0"]),
        ([0.4, 0.37, 0.001, -0.001], ["0.400", "0.370", "0.001", "-0.001"]),
        ([4.0, -0.001], ["4.00", "0.00"]),
        ([0.0, 12.34], ["0.0", "12.3"]),
        ([0.0, 0.0], ["0", "0"]),
        ([2.0, nan, inf, -inf], ["2.00", "nan", "inf", "-inf"]),
        ([1.234e-8, 2e-8], ["1.23e-08", "2e-08"]),
        ([5.0, 12345678.0], ["5", "1.23e+07"]),
        ([], []),
    ],
)
def test_numbers_of_one_quantity_have_the_decimals_of_the_first(values, expected):
    assert evenly(values) == expected
