"""ModelStructure as the attributes of the variables demand it."""

from collections.abc import Iterable, Sequence

from lxml import etree

from orchestrator.checking.description import DescribedVariable, Description, integer
from orchestrator.checking.description_reading import read_description
from orchestrator.checking.findings import Finding
from orchestrator.checking.rules_structure import initial_unknowns_of

_LISTS = frozenset(f"structure.{name}" for name in ("index", "outputs", "initial-unknowns", "duplicate", "order"))
_ORDER = ("Outputs", "Derivatives", "InitialUnknowns")  # of FMI 2.0's sections
_ORDER_3 = ("Output", "ContinuousStateDerivative", "ClockedState", "InitialUnknown", "EventIndicator")


def mend_structure(root: etree._Element, findings: Iterable[Finding]) -> list[str]:
    """Write the lists of outputs and initial unknowns anew where a finding says that they are wrong.

    Entries that are right keep their dependencies; a new entry has none, which means that it depends on everything.
    ``root``: of modelDescription.xml; it is changed.
    """
    if root.find("ModelStructure") is None or not any(finding.rule in _LISTS for finding in findings):
        return []
    d = read_description(root)
    outputs = [v for v in d.variables if v.causality == "output"]
    repairs = _write(d, d.dialect.outputs, outputs, [])
    clocked = [v for v in d.variables if v.clocks]
    return repairs + _write(d, d.dialect.initial_unknowns, initial_unknowns_of(d), clocked)


def _write(
    d: Description, place: str, wanted: Sequence[DescribedVariable], allowed: Sequence[DescribedVariable]
) -> list[str]:
    """Make the entries of one list those of ``wanted``; entries of ``allowed`` may stay."""
    structure = d.root.find("ModelStructure")
    section, _, tag = place.rpartition("/")
    holder = structure.find(section) if section else structure
    old = [] if holder is None else holder.findall(tag)
    name = d.dialect.identity
    numbers = sorted(n for n in {d.identity(v) for v in wanted} if n is not None)
    spare = {d.identity(v) for v in allowed}
    entries: dict[int, etree._Element] = {}
    for entry in old:
        number = integer(entry.get(name))
        if number is not None and (number in numbers or number in spare):
            entries.setdefault(number, entry)
    for number in numbers:
        entries.setdefault(number, etree.Element(tag, {name: str(number)}))
    new = [entries[number] for number in sorted(entries)]
    if [id(e) for e in new] == [id(e) for e in old]:
        return []
    for entry in old:
        holder.remove(entry)
    if section and holder is None and new:
        holder = etree.Element(section)
        structure.insert(_position(structure, section, _ORDER), holder)
    if section:
        holder.extend(new)
        if not new:
            structure.remove(holder)
    elif new:
        first = _position(structure, tag, _ORDER_3)
        for offset, entry in enumerate(new):
            structure.insert(first + offset, entry)
    added = [v.name for n in numbers if entries[n] not in old and (v := d.variable(n)) is not None]
    details = [f"added {', '.join(f'`{n}`' for n in added[:5])}{' ...' if len(added) > 5 else ''}"] if added else []
    if len(old) + len(added) > len(new):
        details.append(f"removed {len(old) + len(added) - len(new)}")
    return [f"wrote the list {section or tag} anew: {', '.join(details) or 'sorted'}"]


def _position(structure: etree._Element, tag: str, order: Sequence[str]) -> int:
    """Where elements of a tag begin."""
    before = order[: order.index(tag)]
    return sum(child.tag in before for child in structure)
