"""What a scenario is, what it expects of the analysis, and the book that lists a module's own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

from ds47.lab.client import Client
from ds47.lab.master import Master
from ds47.lab.stage import Stage


class Actor(Protocol):
    """Who acts in a scene, on a stage of its own."""

    stage: Stage


Who = TypeVar("Who", bound=Actor)
Build = Callable[[Client], None]
Transaction = TypeVar("Transaction")
"""What is expected of a transaction, in the words of the book."""
DIAGNOSES = "DS7"
"""How the ids of diagnoses begin."""
OK_READ = ("read", "ok")
OK_CHANGE = ("change", "ok")


@dataclass(frozen=True, slots=True)
class Expect:
    """What the analysis of the capture must say."""

    transactions: tuple[tuple[str, str], ...]
    """(operation, state) in the order of transaction ids."""
    rules: frozenset[str]
    """Ids DS1xx to DS6xx of all rules that are found, and of no other."""
    diagnoses: frozenset[str] = frozenset()
    """Ids DS7xx of all diagnoses that are given, and of no other."""


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
        """Let it happen on a fresh stage: the same frames every time."""
        actor = self.actor()
        self.build(actor)
        return actor.stage


class Scenes(ABC, Generic[Who, Transaction]):
    """A book of any kind: scenes, who acts in them, and with each what is expected of its transactions."""

    def scene(
        self, shows: str, *transactions: Transaction, rules: str = ""
    ) -> Callable[[Callable[[Who], None]], Callable[[Who], None]]:
        """Decorator: a function of what somebody does becomes a scene of its name; its docstring is the title.

        `rules` are the ids that are expected, with spaces, those of diagnoses among them.
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
        """Enter a scene that a table makes."""


@dataclass(slots=True)
class _Captures(Scenes[Who, tuple[str, str]]):
    """The scenarios of one module, in the order in which they stand there: transactions are (operation, state)."""

    topic: str
    scenarios: list[Scenario] = field(default_factory=list)

    @abstractmethod
    def actor(self) -> Actor:
        """Who acts, on a fresh stage."""

    def add(
        self,
        name: str,
        title: str,
        shows: str,
        build: Callable[[Who], None],
        transactions: Sequence[tuple[str, str]],
        rules: str = "",
    ) -> None:
        """Enter a scenario that is written to a capture of this topic and name."""
        ids = frozenset(rules.split())
        diagnoses = frozenset(rule for rule in ids if rule.startswith(DIAGNOSES))
        expect = Expect(tuple(transactions), ids - diagnoses, diagnoses)
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
