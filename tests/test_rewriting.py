"""Logs that are taken apart and put together again."""

import fuzzing
import pytest
import strict_log
from rewriting import taken_apart

LOGS = fuzzing.logs()


@pytest.mark.parametrize("log", LOGS, ids=lambda log: log.name)
def test_a_log_that_is_put_together_again_holds_the_same(log):
    data = taken_apart(log.data).stored()
    again = strict_log.walk(data)
    assert again.schemas == log.strict.schemas
    assert again.channels == log.strict.channels
    assert again.counted == log.strict.counted
    assert again.indexed == log.strict.indexed
    found, right = (
        [(one.channel, one.log_time_ns, one.payload) for one in log.messages] for log in (again, log.strict)
    )
    assert found == right
    left_out = {0x0E}
    codes, expected = (sorted({one.code for one in log.records} - left_out) for log in (again, log.strict))
    assert codes == expected
