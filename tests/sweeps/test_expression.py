import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweeps.expression import Expression

UNITS = {"hip": "deg", "knee": "deg", "odd name": "m", "carry": "m"}
VALUES = {
    "hip": np.array([0.0, 10.0, 20.0, 30.0]),
    "knee": np.array([5.0, 5.0, 40.0, 0.0]),
    "odd name": np.array([1.0, 2.0, 3.0, 4.0]),
    "carry": np.array([0.1, np.nan, 0.3, 0.4]),
}


def held(text):
    return np.broadcast_to(Expression(text, UNITS)(VALUES.__getitem__), 4).tolist()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("knee<30", [1, 1, 0, 1]),
        ("knee < 30 and hip >= 10", [0, 1, 0, 1]),
        ("not knee == 5 or hip == 0", [1, 0, 1, 1]),
        ("0 < hip <= 20", [0, 1, 1, 0]),
        ("0 < hip < knee", [0, 0, 1, 0]),
        ("hip - 2*knee != -10", [0, 1, 1, 1]),
        ("-hip/10 + 1 > +0", [1, 0, 0, 0]),
        ("'odd name' > 2.5", [0, 0, 1, 1]),
        ("carry > 0", [1, 0, 1, 1]),
        ("hip / knee > 1e299", [0, 0, 0, 1]),
        ("1 < 2", [1, 1, 1, 1]),
        ("(hip > 5) and (hip < 25 or knee < 1) and not hip == 20", [0, 1, 0, 1]),
        (" hip > 5", [0, 1, 1, 1]),
    ],
)
def test_conditions(text, expected):
    assert held(text) == [bool(each) for each in expected]


def test_numbers_and_names():
    value = Expression("hip - 0.5 * 'odd name'", UNITS, "number")
    assert value(VALUES.__getitem__).tolist() == [-0.5, 9.0, 18.5, 28.0]
    assert value.names == {"hip", "odd name"}


def test_comparisons_are_pythons():
    random = np.random.default_rng(3)
    names = list(UNITS)[:2]
    for _ in range(300):
        a, b, c = random.choice(["<", "<=", ">", ">=", "==", "!="], 3)
        join, no = random.choice(["and", "or"]), random.choice(["", "not "])
        text = f"{no}{names[0]} {a} {names[1]} {b} 5 {join} hip - knee {c} {random.integers(30)}"
        expected = [
            eval(text, {"hip": h, "knee": k}) for h, k in zip(*map(VALUES.get, names), strict=True)
        ]
        assert held(text) == expected, text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("kneee<30", r"names 'kneee', which is unknown: there are hip \[deg\], knee \[deg\], odd"),
        ("knee", "is a number, a condition is wanted"),
        ("knee and hip", "has the number 'knee' where a condition belongs"),
        ("not knee", "has the number 'knee' where a condition"),
        ("(knee<3)+1 > 0", r"has the condition 'knee < 3' where a number"),
        ("knee = 30", "cannot be read: it is made of names, numbers"),
        ("", "cannot be read"),
        ("knee <", "cannot be read"),
        ("knee\0<3", "cannot be read"),
        ("__import__('os').system('true') < 1", "in it: it is made of"),
        ("hip.real < 1", "has 'hip.real' in it"),
        ("hip[0] < 1", r"has 'hip\[0\]' in it"),
        ("hip ** 9 < 1", r"has 'hip \*\* 9' in it"),
        ("hip % 9 < 1", "has 'hip % 9' in it"),
        ("hip in (1, 2)", r"has 'hip in \(1, 2\)' in it"),
        ("(lambda: hip)() < 1", "in it: it is made of"),
        ("hip if knee else hip < 1", "in it: it is made of"),
        ("f'{hip}' < 1", "in it: it is made of"),
        ("(hip := 3) < 1", "in it: it is made of"),
        ("True", "has 'True' in it"),
        ("hip < 1j", "has '1j' in it"),
        ("hip < 1e999", "holds a number beyond 1e300"),
        ("hip < 1" + "0" * 400, "holds a number beyond 1e300"),
        ("hip < " + "-" * 900 + "11", "is more than 50 levels deep"),
        ("(" * 300 + "hip" + ")" * 300 + " < 1", "cannot be read"),
        ("hip < " + "1 + " * 400 + "1", "text of up to 1000 characters"),
    ],
)
def test_what_is_refused_in_one_line(text, words):
    with pytest.raises(kd.InvalidInput, match=words) as refused:
        Expression(text, UNITS)
    assert "\n" not in str(refused.value)


def test_a_condition_is_no_number():
    with pytest.raises(kd.InvalidInput, match="is a condition, a number is wanted, such as ball"):
        Expression("hip < 3", UNITS, "number")
