"""Which fits the study makes: strategy, trials, starts, with or without the bench."""

from __future__ import annotations

from dataclasses import dataclass

TIERS = ("exact", "laboratory")
SETTINGS = ("low", "medium", "high")
TRIALS = tuple(f"{setting}_{i}" for setting in SETTINGS for i in (1, 2, 3))
ALONE = tuple(f"{setting}_1" for setting in SETTINGS)
"""The trials that are fitted alone; the first is the one that is reported."""
PAIR = ("low_1", "high_1")
"""The soft and the stiff trial of the reported transfer."""
STARTS, SETTLED = 5, 10
WRONG_KEEL, KEEL_SPREAD = 1.4, 0.5
"""Of an unknown keel and fulcrum: how much too stiff the first guess of the keel is, and the
relative standard deviation of what is believed of both (choices)."""
JOINT, PAPER = "joint", "paper"


@dataclass(frozen=True, kw_only=True)
class Case:
    """One fit; the trials that are not fitted are held out.

    Attributes:
        tier: of the reference subject. strategy: JOINT or PAPER. fitted: trials.
        bench: whether the bench is fitted as well; without, and by PAPER, it only judges.
        keel_known: whether the calibrated compliance of keel and fulcrum is given to JOINT;
            otherwise it begins with a keel that is WRONG_KEEL times as stiff, and fits both.
        resultant: whether JOINT compares the resultant alone, in place of components and centre of
            pressure.
        starts: searches of JOINT. settled: of PAPER, see its options.
        leave_out: whether to fit again without each trial and each stiffness.
    """

    tier: str
    strategy: str
    fitted: tuple[str, ...]
    bench: bool = True
    keel_known: bool = True
    resultant: bool = False
    starts: int = STARTS
    settled: int = 1
    leave_out: bool = False

    @property
    def held_out(self) -> tuple[str, ...]:
        return tuple(name for name in TRIALS if name not in self.fitted)

    @property
    def name(self) -> str:
        how = (
            (f"settled_{self.settled}",)
            if self.strategy == PAPER
            else (
                *(() if self.bench else ("without_bench",)),
                *(() if self.keel_known else ("keel_unknown",)),
                *(("resultant",) if self.resultant else ()),
                f"{self.starts}_starts",
            )
        )
        return "-".join((self.tier, self.strategy, "+".join(self.fitted), *how))


def transfer(tier: str, *, starts: int = STARTS) -> Case:
    """The reported pair."""
    return Case(tier=tier, strategy=JOINT, fitted=PAIR, starts=starts, leave_out=starts > 1)


def other_pairs(tier: str) -> list[Case]:
    """The other eight of a soft and a stiff trial, searched from one start each."""
    pairs = [(f"low_{i}", f"high_{j}") for i in (1, 2, 3) for j in (1, 2, 3)]
    return [
        Case(tier=tier, strategy=JOINT, fitted=pair, starts=1) for pair in pairs if pair != PAIR
    ]


def one_trial(tier: str) -> list[Case]:
    """Joint fits of a single trial; the first is the one that is reported."""
    return [Case(tier=tier, strategy=JOINT, fitted=(name,)) for name in ALONE]


def without_bench(tier: str) -> list[Case]:
    """The same, and the pair, by recordings alone."""
    return [
        Case(tier=tier, strategy=JOINT, fitted=fitted, bench=False)
        for fitted in (*((a,) for a in ALONE), PAIR)
    ]


def keel_unknown(tier: str) -> list[Case]:
    """One soft trial, one stiff trial and both, by recordings alone, of a device that nobody has
    calibrated."""
    return [
        Case(tier=tier, strategy=JOINT, fitted=fitted, bench=False, keel_known=False)
        for fitted in (PAIR[:1], PAIR[1:], PAIR)
    ]


def resultant_alone(tier: str) -> list[Case]:
    """One trial and the pair by the resultant force alone: neither components, centre of pressure
    nor bench."""
    return [
        Case(tier=tier, strategy=JOINT, fitted=fitted, bench=False, resultant=True)
        for fitted in (ALONE[:1], PAIR)
    ]


def paper_literal(tier: str) -> list[Case]:
    """The paper's procedure, which ends at the first iteration that finds nothing better."""
    return [Case(tier=tier, strategy=PAPER, fitted=(name,)) for name in ALONE]


def paper_settled(tier: str) -> list[Case]:
    """The same on the reported trial, which ends when SETTLED iterations in a row found nothing
    better."""
    return [Case(tier=tier, strategy=PAPER, fitted=ALONE[:1], settled=SETTLED)]


def cases(tier: str) -> list[Case]:
    """All of a tier."""
    return [
        transfer(tier),
        *one_trial(tier),
        *other_pairs(tier),
        *without_bench(tier),
        *keel_unknown(tier),
        *resultant_alone(tier),
        *paper_literal(tier),
        *paper_settled(tier),
    ]
