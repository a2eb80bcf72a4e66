"""Pickles are read as data: the same values as Python's unpickler gives, and no code is run."""

import pickle
import pickletools
import tracemalloc

import numpy as np
import published_factory as forge
import pytest
import study_data
from hypothesis import given
from hypothesis import strategies as st

from navirl_cli.errors import ArtefactError
from navirl_cli.published import pickled
from navirl_cli.published.fields import unpacked
from navirl_cli.published.pickled import NAMES, Kept, Name, read_pickle

NO_PICKLE = (
    r"^x\.pkl: expected a pickle of protocol 0, as the study is published, found {} before byte \d+ of \d+; download"
)

numbers = st.integers(-(10**18), 10**18) | st.floats(allow_nan=False) | st.booleans() | st.none()
texts = st.text(max_size=8)
values = st.recursive(
    numbers | texts,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.lists(inner, max_size=4).map(tuple)
        | st.dictionaries(texts | st.integers(-5, 5), inner, max_size=4)
    ),
    max_leaves=12,
)


def read(data):
    return read_pickle(data, "x.pkl")


def refused(found):
    return pytest.raises(ArtefactError, match=NO_PICKLE.format(found))


def peak_of(function, *args):
    """Most bytes that a call held, and what it returned or raised."""
    tracemalloc.start()
    try:
        try:
            result = function(*args)
        except (ArtefactError, ValueError) as error:
            result = error
        return tracemalloc.get_traced_memory()[1], result
    finally:
        tracemalloc.stop()


@given(values)
def test_plain_values_are_read_as_python_reads_them(value):
    found = read(pickle.dumps(value, protocol=0))
    assert found == value
    assert repr(found) == repr(value), "1, 1.0 and True are equal, but not the same"


@given(st.binary(max_size=40))
def test_strings_of_python_2_are_read_as_latin_1(data):
    text = data.decode("latin-1")
    assert read(forge.dumped(text)) == text == pickle.loads(forge.dumped(text), encoding="latin-1")


def test_shared_and_circular_parts_stay_so():
    inner = [1]
    twice = read(pickle.dumps([inner, inner], protocol=0))
    assert twice[0] is twice[1]
    circular = read(b"(lp0\ng0\na.")
    assert circular[0] is circular


# What runs code when Python unpickles it: by REDUCE, by INST, through copy_reg, and by names within admitted ones.
COMMAND = "S'touch {marker}'\n"
RUNS = {
    "reduce": "cos\nsystem\n(" + COMMAND + "tR.",
    "eval": 'c__builtin__\neval\n(S\'__import__("os").system("touch {marker}")\'\ntR.',
    "inst": "(" + COMMAND + "iposix\nsystem\n.",
    "copy_reg": "ccopy_reg\n_reconstructor\n(csubprocess\nPopen\nc__builtin__\nobject\nNtR(d"
    "S'args'\n(lS'touch'\naS'{marker}'\nasb.",
    "within": "cnumpy\nload.__globals__\n.",
}


@pytest.mark.parametrize(
    ("way", "name"),
    [
        ("reduce", "os.system"),
        ("eval", "__builtin__.eval"),
        ("inst", "posix.system"),
        ("copy_reg", "subprocess.Popen"),
        ("within", "numpy.load.__globals__"),
    ],
)
def test_a_pickle_that_names_anything_else_is_refused_and_runs_no_code(tmp_path, way, name):
    marker = tmp_path / "ran"
    forged = RUNS[way].format(marker=marker).encode()
    with pytest.raises(
        ArtefactError,
        match=rf"^x\.pkl: expected only names that the published study needs, found {name} before byte \d+; "
        "no code was run; download the file from its authors again$",
    ):
        read(forged)
    assert not marker.exists()
    if way in {"reduce", "eval", "inst"}:
        pickle.loads(forged)
        assert marker.exists(), "the forgery does run where pickles may"


def test_a_name_of_many_lines_cannot_hide_in_the_message():
    with pytest.raises(ArtefactError, match=r"found 'os\\x1b\[2J.system' before"):
        read(b"cos\x1b[2J\nsystem\n.")


@pytest.mark.parametrize("name", sorted(NAMES))
def test_an_admitted_name_is_only_kept(name):
    module, _, last = name.rpartition(".")
    assert read(f"c{module}\n{last}\n.".encode()) == Name(name)
    assert read(f"(I1\ni{module}\n{last}\n.".encode()) == Kept(name, (1,))
    kept = read(f"c{module}\n{last}\n(I1\ntR(dS'a'\nI2\nsb.".encode())
    assert kept == Kept(name, (1,), {"a": 2})


def test_an_object_of_a_class_of_our_own_is_kept_by_its_name():
    found = read(forge.dumped(forge.Message("genpy.rostime.Time", [1, 2])))
    assert found == Kept("genpy.rostime.Time", (), [1, 2])


@pytest.mark.parametrize("opcode", pickletools.opcodes, ids=lambda opcode: opcode.name)
def test_no_operation_beyond_those_of_protocol_0(opcode):
    admitted = set("(ILFSVNltdaspgcRib.")
    if opcode.code in admitted:
        assert opcode.proto == 0
    else:
        with refused(f"operation {pickletools_repr(opcode.code)}"):
            read(b"(I1\n" + opcode.code.encode("latin-1") + b"1\n.")


def pickletools_repr(code):
    return repr(code).replace("\\", r"\\").replace("(", r"\(").replace(")", r"\)").replace("]", r"\]")


@pytest.mark.parametrize("protocol", [1, 2, 3, 4, 5])
def test_pickles_of_later_protocols_are_refused(protocol):
    with refused("operation .*"):
        read(pickle.dumps({"passing_1": [1.5, 2]}, protocol=protocol))


def test_every_prefix_is_refused():
    said = {"world_poses": [(1.5, -2e-15)], "people_pos": [[52, np.int64(26)]], "nav_map": np.eye(2, dtype=np.int64)}
    whole = forge.dumped({"a": [forge.Old("demonstration.Demonstration", said)], "frame": "map", "none": None})
    assert read(whole)["frame"] == "map"
    for length in range(len(whole)):
        with refused("its end( within a line)?"):
            read(whole[:length])


@pytest.mark.skipif(not study_data.ROOT.is_dir(), reason=study_data.REASON)
def test_a_published_file_that_is_cut_anywhere_is_refused():
    whole = next(study_data.ROOT.glob("runs/*/force_demos.pkl")).read_bytes()
    assert set(read(whole)) == {"passing_1", "passing_2", "replay", "obstacle_course"}
    for length in np.random.default_rng(0).integers(0, len(whole), 20):
        with refused("its end( within a line)?"):
            read(whole[:length])


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (b"hello\n", "operation 'h'"),
        (b"<html>", "operation '<'"),
        (b"\x1f\x8b\x08\x00", r"operation '\\x1f'"),
        (b".", "more than one value at its end"),
        (b"NN.", "more than one value at its end"),
        (b"(N.", "more than one value at its end"),
        (b"N.N", "more than one value at its end"),
        (b"a.", "an operation without its operand"),
        (b"Na.", "an operation on no list"),
        (b"(dNNs.", "a dictionary's key that is neither text nor integer"),
        (b"(Nd.", "a dictionary's key that is neither text nor integer"),
        (b"NI1\nNs.", "an operation on no dict"),
        (b"t.", "an operation without its mark"),
        (b"NNb.", "an operation on no kept"),
        (b"NNR.", "a call of no name"),
        (b"I1\n(tR.", "a call of no name"),
        (b"cnumpy\ndtype\nNR.", "a call of no name"),
        (b"p0\n.", "no value to remember"),
        (b"g0\n.", "a reference to no value"),
        (b"I1x\n.", "no integer of at most 19 digits"),
        (b"L" + b"9" * 1_000_000 + b"L\n.", "no integer of at most 19 digits"),
        (b"Fnought\n.", "no number"),
        (b"F" + b"1" * 1_000_000 + b"\n.", "no number"),
        (b"Sabc\n.", "no string in quotes"),
        (b"S'\n.", "no string in quotes"),
        (b"S'a\\\n.", "no string in quotes"),
        (b"S'\\N{BELL}'\n.", "no string in quotes"),
        (b"S'\xff'\n.", "no string in quotes"),
        (b"V\\u12\n.", "no text"),
    ],
    ids=lambda value: value[:12] if isinstance(value, bytes) else "",
)
def test_what_is_no_pickle_is_refused(data, found):
    with refused(found):
        read(data)


def test_a_memo_of_a_huge_number_takes_no_memory():
    peak, found = peak_of(read, b"(lp4000000000\ng4000000000\na.")
    assert isinstance(found, list)
    assert peak < 100_000


def test_a_shape_that_claims_gigabytes_is_refused_before_anything_is_allocated():
    array = read(forge.dumped(np.zeros((2, 2))))
    array.state = (1, (1 << 20, 1 << 20), *array.state[2:])
    peak, error = peak_of(unpacked, array)
    assert str(error) == "expected 32 bytes to be an array of f8, found its shape to be (1048576, 1048576)"
    assert peak < 100_000


def test_keys_that_would_take_for_ever_to_hash_are_refused():
    nested = b"((tp0\n" + b"(g0\ng0\ntp0\n" * 200 + b"l"  # each holds the one before twice
    with refused("a dictionary's key that is neither text nor integer"):
        read(b"(" + nested + b"(dg0\nNst.")


def test_deep_nesting_is_read_and_forgotten_without_recursion():
    deep = read(b"(l" * 50_000 + b"a" * 49_999 + b".")
    for _ in range(49_999):
        (deep,) = deep
    assert deep == []
    instances = b"(inav_map\nNavMap\n"
    assert read(instances * 50_000 + b"b" * 49_999 + b".").name == "nav_map.NavMap"


def test_a_pickle_of_very_many_operations_is_refused(monkeypatch):
    monkeypatch.setattr(pickled, "MOST_OPERATIONS", 1000)
    assert len(read(b"(" + b"N" * 997 + b"t.")) == 997
    with refused("more than 1000 operations"):
        read(b"(" + b"N" * 998 + b"t.")


@pytest.mark.parametrize("kind", ["f4", "f8", "i1", "i4", "i8", "u1", ">f8", ">i4"])
def test_numbers_of_numpy(kind):
    values = np.array([[1, 2, 100], [0, 7, 65]], dtype=kind)
    found = unpacked(read(forge.dumped(values)))
    assert found.tolist() == values.tolist()
    number = unpacked(read(forge.dumped(values[0, 2])))
    assert number == 100
    assert type(number) is (float if "f" in kind else int)


def test_an_array_in_fortrans_order():
    array = read(forge.dumped(np.arange(6.0)))
    array.state = (1, (2, 3), array.state[2], True, array.state[4])
    assert unpacked(array).tolist() == [[0, 2, 4], [1, 3, 5]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({2: Kept("numpy.dtype", ("O8", 0, 1))}, r"^expected plain numbers \(f4, f8, i1, i4, i8, u1\), found 'O8'$"),
        ({2: Kept("numpy.dtype", ([],))}, "^expected plain numbers .*, found a list$"),
        ({2: None}, "^expected plain numbers .*, found None$"),
        ({1: (3,)}, r"^expected 32 bytes to be an array of f8, found its shape to be \(3,\)$"),
        ({1: (-2, -2)}, r"found its shape to be \(-2, -2\)$"),
        ({1: (0, 1 << 62)}, "found its shape to be "),
        ({1: (True, 4)}, "found its shape to be a tuple$"),
        ({1: (4,) * 1000}, "^expected an array's shape, of at most two sides, and its bytes, found something else$"),
        ({1: None}, "^expected an array's shape"),
        ({4: None}, "^expected an array's shape"),
    ],
)
def test_an_array_of_anything_else_is_refused(change, message):
    array = read(forge.dumped(np.zeros((2, 2))))
    array.state = tuple(change.get(place, value) for place, value in enumerate(array.state))
    with pytest.raises(ValueError, match=message):
        unpacked(array)


def test_a_number_without_its_bytes_is_refused():
    with pytest.raises(ValueError, match=r"^expected plain numbers of numpy, found them incomplete$"):
        unpacked(read(b"cnumpy.core.multiarray\nscalar\n(tR."))
