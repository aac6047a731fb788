"""The paper, item by item, with the sentences and the other coefficients."""

from kickdyn.paper.reproduce import SECTIONS


def compared(section):
    items, others = section.compare()
    return {"items": [item.as_json() for item in items], "others": [item.as_json() for item in others],
            "differences": [item.difference for item in items]}  # fmt: skip


CASES = {section.name: (lambda section=section: compared(section)) for section in SECTIONS}
LOOSE = {"": 1e-4}
