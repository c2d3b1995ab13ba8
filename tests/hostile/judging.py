"""What is a finding: everything but a result, or one clear line and nothing else."""

import re
from dataclasses import dataclass

from tests.hostile.case import Arguments, Case
from tests.hostile.sandbox import MEMORY, PATIENCE_S, Outcome

LONGEST = 600  # characters of a message
SLOW_S = 8.0
_ESTIMATE = re.compile(r"flight +km +time |.* \d+\.\d\d +\d+:\d\d +\d+:\d\d ")  # the table of a plan
_SAID = re.compile(  # what a command says on stderr beside its errors
    r"uavseg: (warning|note): |note: |  [a-z -]+ {2,}|wrote |out[^:]*: \d+ regions?, |resumed: |[^:]*: (\d+ regions?, )?\d+ items, |"
    r" *kept out of [\d,]+ cells| *G per pixel |uavseg: interrupted|undecided is what lies at |"
    r"what lies at |Is this wanted\? |standard input has ended|no more questions; |there are \d answers: "
)
_DETAIL = re.compile(r"uavseg: (?!error: )")  # with --verbose
_PROGRESS = re.compile(r"progress \d+$")  # with --progress plain
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
_RAW = re.compile(
    r"invalid literal for|could not convert string|'\w+' object |object is not |has no attribute|index out of range|"
    r"not supported between|codec can't|\[Errno|<class '|NoneType|\b0x[0-9a-f]{8}|unexpected keyword|"
    r"broadcast|positional argument|takes \d+ (?!%)|unpack|dtype\(|np\.\w+\(|Traceback|UserWarning|cannot convert float|"
    r"ufunc|must be real number|must be str|not subscriptable|"
    r"^uavseg: (error|warning): a library warns"
)
_WARNING = re.compile(r"\w*Warning: ")
_FRAME = re.compile(r'File "[^"]*/(uavseg/[^"]*)", line \d+,? in (\w+)')
_OWN = re.compile(r"#(\w+)# (.*)")


@dataclass(frozen=True, order=True)
class Finding:
    """What went wrong, and what tells it from other faults.

    Parameters
    ----------
    kind : str
    signature : str
        The same for two cases of one fault, as well as that can be seen.
    detail : str
    """

    kind: str
    signature: str
    detail: str


def judge(case: Case, outcomes: list[Outcome]) -> list[Finding]:
    """All that is wrong with what a case did."""
    found = [finding for n, outcome in enumerate(outcomes) for finding in _judge_one(case, n, outcome)]
    if case.same and not found:
        found += _judge_same(outcomes)
    return found


def _judge_one(case: Case, n: int, outcome: Outcome) -> list[Finding]:
    err = outcome.err.decode("utf-8", "surrogateescape")
    where = _frame(err)
    name = case.commands[n][0] if case.commands else ""
    if outcome.seconds > PATIENCE_S:
        return [Finding("HANG", f"{name} {where}", f"{outcome.seconds:.0f} s")]
    found = []
    if outcome.grown > MEMORY:
        found.append(
            Finding("MEM", f"{name} {where}", f"grew by {outcome.grown >> 20} MB, code {outcome.code}")
        )
    if outcome.code < 0 and not found:
        return [Finding("CRASH", f"{name} {where}", f"signal {-outcome.code}: {err[-300:]}")]
    if outcome.code < 0:
        return found
    if "Traceback (most recent call last)" in err or "Exception ignored" in err:
        lines = [
            line for line in err.splitlines() if re.match(r"[\w.]*\w(Error|Exception|Interrupt)\b", line)
        ]
        return [*found, Finding("TRACEBACK", f"{_digest(lines[-1] if lines else '')} {where}", err[-600:])]
    if case.call is not None:
        return found + [Finding(kind, _digest(text), text) for kind, text in _OWN.findall(err)]
    if outcome.cpu_seconds > SLOW_S:
        found.append(Finding("SLOW", name, f"{outcome.cpu_seconds:.0f} s of work, code {outcome.code}"))
    words = case.commands[n] if case.commands else ()
    several = "--each" in words
    found += _judge_text(err, outcome.code, words)
    printed = outcome.out.decode("utf-8", "surrogateescape").replace("\r\n", "")
    if _CONTROL.search(_without_separators(printed) if _separates(case, n) else printed):
        found.append(Finding("CTRLOUT", name, repr(outcome.out[:200])))
    return found + _judge_files(case, name, outcome, several)


def _separates(case: Case, n: int) -> bool:
    """Whether a command asks for record separators (RFC 8142)."""
    return bool(case.commands) and "--rs" in case.commands[n]


def _without_separators(text: str) -> str:
    """GeoJSON text sequence without the record separator that begins each of its lines."""
    return re.sub(r"^\x1e(?={)", "", text, flags=re.MULTILINE)


def _judge_text(err: str, code: int, words: Arguments) -> list[Finding]:
    """Each line is one of ours; with --each, one source that fails has an error of its own."""
    found = []
    requested = [_DETAIL] * bool({"-v", "--verbose"} & set(words)) + [_PROGRESS] * ("plain" in words)
    known = (_SAID, _ESTIMATE, *requested)
    lines = err.split("\n")
    lines = lines[:-1] if lines[-1] == "" else lines
    if code == 2 and any(line.startswith("Error: ") for line in lines):
        lines = [line for line in lines if line.strip() and not line.startswith(("Usage: ", "Try "))]
        errors = [line for line in lines if line.startswith("Error: ")]
        others = [line for line in lines if not line.startswith(("Error: ", "  ", "uavseg: "))]
    else:
        errors = [line for line in lines if line.startswith("uavseg: error: ")]
        others = [
            line
            for line in lines
            if not (line.startswith("uavseg: error: ") or any(kind.match(line) for kind in known))
        ]
    if code not in (0, 1, 2):
        found.append(Finding("CODE", str(code), err[-300:]))
    if len(errors) != (code != 0) and not ("--each" in words and code == 1 and errors):
        found.append(
            Finding(
                "MSG", f"{len(errors)} errors, code {code} {_digest(lines[-1] if lines else '')}", err[-500:]
            )
        )
    for line in others:
        kind = "PYWARN" if _WARNING.search(line) else "STRAY"
        found.append(Finding(kind, _digest(line), line[:500]))
    for line in lines:
        if _CONTROL.search(line):
            found.append(Finding("CTRLMSG", _digest(_CONTROL.sub("", line)), ascii(line[:300])))
        if len(line) > LONGEST:
            found.append(Finding("LONGMSG", _digest(line), f"{len(line)}: {line[:300]}"))
        if _RAW.search(line):
            found.append(Finding("RAWMSG", _digest(line), line[:400]))
        if re.search(r"/\.[\w.]+\.[a-z0-9_]{8}/", line):
            found.append(Finding("TMPPATH", _digest(line), line[:400]))
    return found


def _judge_files(case: Case, name: str, outcome: Outcome, several: bool) -> list[Finding]:
    found = []
    if outcome.code != 0 and not several and (outcome.made or outcome.changed or outcome.gone):
        kept = tuple(made for made in outcome.made if made.partition("/")[0] != "done")
        if kept or outcome.changed or outcome.gone:
            text = f"new {kept} changed {outcome.changed} gone {outcome.gone}"
            found.append(Finding("LEFTOVER", f"{name} {text}"[:120], text[:400]))
    else:
        others = [
            made
            for made in outcome.made
            if not made.startswith(case.targets)
            and not any(_is_flight(made, target) for target in case.targets)
            and not re.search(r"\.(regions|levels|states|match|preview)\.", made)
        ]
        others = [made for made in others if "." not in case.targets]
        changed = [made for made in outcome.changed if not made.startswith(case.targets)]
        if others or changed or outcome.gone:
            found.append(Finding("BESIDE", name, f"{others} {changed} {outcome.gone}"))
    if outcome.outside:
        found.append(Finding("OUTSIDE", f"{name} {outcome.outside}"[:160], f"{outcome.outside}"))
    return found


def _is_flight(made: str, target: str) -> bool:
    """Whether a file is one of the flights that a mission is divided into."""
    stem, dot, suffix = target.rpartition(".")
    return re.fullmatch(re.escape(stem) + r"-\d+" + re.escape(dot + suffix), made) is not None


def _judge_same(outcomes: list[Outcome]) -> list[Finding]:
    first, *others = outcomes
    for other in others:
        if (first.code, _said(first)) != (other.code, _said(other)):
            return [
                Finding("DIFF-LIST", f"{first.code} {other.code}", f"{_said(first)} :: {_said(other)}"[:900])
            ]
        if [digest for _, digest in first.digests] != [
            digest for _, digest in other.digests
        ] or first.out != other.out:
            return [Finding("DIFF-BYTES", f"{first.code}", f"{first.digests} :: {other.digests}")]
    return []


def _said(outcome: Outcome) -> list[str]:
    """Errors and warnings of a command."""
    return [
        line for line in outcome.err.decode("utf-8", "replace").splitlines() if line.startswith("uavseg: ")
    ]


def _frame(err: str) -> str:
    """The innermost place in uavseg that a traceback names."""
    found = _FRAME.findall(err)
    if "Fatal Python error" in err or "most recent call first" in err:
        return "@ " + ":".join(found[0]) if found else ""
    return "@ " + ":".join(found[-1]) if found else ""


def _digest(text: str) -> str:
    """A message without what differs from case to case."""
    text = re.sub(r"'[^']*'|\"[^\"]*\"", "'..'", text)
    text = re.sub(r"(?<=[ (,=:])[-+]?(\d[\w.+-]*|nan|inf)", "#", text)
    return _CONTROL.sub("", text)[:140]
