"""What a scenario is, what it expects of the analysis, and the book of the scenarios of a module."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

from ds47.lab.client import Client
from ds47.lab.master import Master
from ds47.lab.stage import Stage


class Actor(Protocol):
    """The actor of a scene, on its own stage."""

    stage: Stage


Who = TypeVar("Who", bound=Actor)
Build = Callable[[Client], None]
Transaction = TypeVar("Transaction")
"""What a book expects of a transaction."""
DIAGNOSES = "DS7"
"""The prefix of the ids of diagnoses."""


@dataclass(frozen=True, slots=True)
class Expect:
    """What the analysis of the capture must say."""

    transactions: tuple[tuple[str, str], ...]
    """(operation, state) in the order of transaction ids."""
    rules: frozenset[str]
    """Exactly the rules DS1xx to DS6xx that are found."""
    diagnoses: frozenset[str] = frozenset()
    """Exactly the diagnoses DS7xx that are made."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """One capture that the lab can write."""

    name: str
    title: str
    shows: str
    build: Callable[[Any], None]
    expect: Expect
    actor: Callable[[], Actor]

    def play(self) -> Stage:
        """Play it on a fresh stage: the same frames every time."""
        actor = self.actor()
        self.build(actor)
        return actor.stage


class Scenes(ABC, Generic[Who, Transaction]):
    """A book of any kind: scenes, their actor, and what each expects of its transactions."""

    def scene(
        self, shows: str, *transactions: Transaction, rules: str = ""
    ) -> Callable[[Callable[[Who], None]], Callable[[Who], None]]:
        """Decorator: a function that acts becomes a scene of its name; its docstring is the title.

        `rules` are the expected ids, separated by spaces, including those of diagnoses.
        """

        def enter(build: Callable[[Who], None]) -> Callable[[Who], None]:
            name = build.__name__.rstrip("_").replace("_", "-")
            title = (build.__doc__ or "").strip().rstrip(".")
            self.add(name, title, shows, build, transactions, rules)
            return build

        return enter

    @abstractmethod
    def add(
        self,
        name: str,
        title: str,
        shows: str,
        build: Callable[[Who], None],
        transactions: Sequence[Transaction],
        rules: str = "",
    ) -> None:
        """Add a scene directly, for example from a table."""


@dataclass(slots=True)
class _Captures(Scenes[Who, str]):
    """The scenarios of one module in their order.

    What one expects is text: `2 read ok, change refused, DS203 DS705`.
    """

    topic: str
    scenarios: list[Scenario] = field(default_factory=list)

    @abstractmethod
    def actor(self) -> Actor:
        """A new actor on a fresh stage."""

    def scenes(self, build: Callable[..., None], *rows: tuple[Any, ...]) -> None:
        """Add scenes that one function plays: name, title, what it shows, what it expects, arguments of each.

        What shows nothing else ("") shows its rules.
        """
        for name, title, shows, expect, *given in rows:
            rules = expect.partition("DS")[1] + expect.partition("DS")[2]
            shows = shows or f"{rules.replace(' ', ', ')} and no other finding"

            def play(who: Who, given: Sequence[Any] = given) -> None:
                build(who, *given)

            self.add(name, title, shows, play, [expect])

    def add(
        self,
        name: str,
        title: str,
        shows: str,
        build: Callable[[Who], None],
        transactions: Sequence[str],
        rules: str = "",
    ) -> None:
        """Add a scenario for the capture of this topic and name."""
        expected: list[tuple[str, str]] = []
        for part in ", ".join(transactions).split(", "):
            if part.startswith("DS"):
                rules = part
            elif part:
                *count, operation, state = part.split()
                expected += [(operation, state)] * int(*count or "1")
        ids = frozenset(rules.split())
        diagnoses = frozenset(rule for rule in ids if rule.startswith(DIAGNOSES))
        expect = Expect(tuple(expected), ids - diagnoses, diagnoses)
        whole = f"{self.topic}-{name}"
        self.scenarios.append(Scenario(whole, title, shows, build, expect, self.actor))


class Book(_Captures[Client]):
    """Scenarios of a controller on PROFINET."""

    def actor(self) -> Client:
        """A client on a stage of Ethernet."""
        return Client(Stage())


class BusBook(_Captures[Master]):
    """Scenarios of a master on PROFIBUS."""

    def actor(self) -> Master:
        """A master on a line."""
        return Master()
