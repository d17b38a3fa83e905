"""Activations of a subtree under `Train` in many worlds at once (`gymnasium.vector.VectorEnv`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from py_trees.behaviour import Behaviour

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import LONGEST
from bt_tasksim.policy.policy import Policy
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.training.drawn_worlds import Draws
from bt_tasksim.training.episode_batch import EpisodeBatch
from bt_tasksim.training.happened import Happened
from bt_tasksim.training.reward import Reward


class Ready(NamedTuple):
    """What is new in the worlds that wait for an action, of which there are ``k``.

    Attributes:
        features: What is seen now ``(k, n)``, float32.
        rewards: What the action before has paid ``(k,)``; 0 where there was none, after a reset.
        terminated: Boolean ``(k,)``: with it an episode ended, and ``features`` are the next one's first.
        truncated: Boolean ``(k,)``: likewise, and it was cut off.
        infos: Of each, as `EpisodeEnv` has it; with ``final_obs`` and ``final_info`` where an episode ended.
    """

    features: Array
    rewards: Array
    terminated: Array
    truncated: Array
    infos: list[dict[str, Any]]


class EpisodeVectorEnv(VectorEnv[Array, Array, Array]):
    """Episodes of `bt_tasksim.training.env.EpisodeEnv` in many worlds of one process.

    Spaces, rewards and what is said are those of an `EpisodeEnv`. A world whose episode has ended begins the
    next one within the same step (`gymnasium.vector.AutoresetMode.SAME_STEP`).

    Between two decisions of a world there may be a hundred ticks, while others wait for their next action.
    Besides ``step``, which waits for all worlds, there are `send` and `recv`, for those that are ready. What
    a world comes to does not depend on which of the two is used.

    Args:
        tree: The tree, with one `Train` node at least.
        scene: The scene.
        num_envs: How many worlds.
        train: Name of the `Train` node; by default the first one.
        options: Engines; by default SAPIEN with the noise model ``original``.
        reward: What is paid.
        stream: Stream of draws, see `bt_tasksim.scene.configuration.STREAMS`.
        stage: Number of the scene's stage that worlds are drawn from; None: the scene itself.
        longest: Seconds of an episode, earlier siblings included, after which it is truncated.
        policies: Policies of other leaves, by the leaf's name: what was trained before.
        threads: How many threads step the worlds.
        build: Makes one more tree of the same shape: needed where a behaviour of your own, or of py_trees,
            has no form for many worlds, and so is ticked world by world, in a tree for each.

    Raises:
        InputError: See `bt_tasksim.training.episode_batch.EpisodeBatch`.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(
        self,
        tree: Behaviour,
        scene: WorldSource,
        num_envs: int = 8,
        train: str | None = None,
        options: EngineOptions | None = None,
        reward: Reward | None = None,
        stream: str = "training",
        stage: int | None = None,
        longest: float = LONGEST,
        policies: Mapping[str, Policy] | None = None,
        threads: int = 1,
        build: Callable[[], Behaviour] | None = None,
    ) -> None:
        about = tree, scene, train, options, reward, longest, policies
        self.batch = EpisodeBatch(*about, worlds=num_envs, threads=threads, build=build)
        self.stream, self.stage, self.num_envs = stream, stage, num_envs
        self.single_observation_space = self.batch.observation_space
        self.single_action_space = self.batch.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.redrawn = 0
        """Draws so far that had no world, or in which the subtree was never active."""
        self.discarded = 0
        """Episodes so far that an error spoiled."""
        self._rngs: list[np.random.Generator | None] = [None] * num_envs
        self._ended: dict[int, Happened] = {}

    # ---- all worlds at once -----------------------------------------------------------------------------

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode in every world.

        Args:
            seed: Of the first world's draws, one more for each further world; or one for each.
            options: ``reset_mask``: boolean ``(N,)``, the worlds that begin; the others stay as they are, and
                must wait for an action. ``draw``: ``(N,)``, the seed of each world's draw, instead of a
                random one; those of later episodes are random again.

        Raises:
            InputError: Seeds or draws are not as many as the worlds, or a world had no episode in many draws.
            ClosedEnvironmentError: It is closed.
        """
        rows = np.arange(self.num_envs)
        mask = None if options is None else options.get("reset_mask")
        if mask is not None:
            rows = np.flatnonzero(np.asarray(mask, bool))
        self.begin(rows, seed, None if options is None else options.get("draw"))
        ready = self.wait(rows)
        return ready.features, self._told(ready)

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Give every world its action ``(N, actions + 1)``, and go on to the next decision of each.

        Raises:
            InputError: The actions have the wrong shape or are not finite.
            RuntimeError: There is no episode in one of them.
            ClosedEnvironmentError: It is closed.
        """
        rows = np.arange(self.num_envs)
        self.send(rows, actions)
        ready = self.wait(rows)
        return ready.features, ready.rewards, ready.terminated, ready.truncated, self._told(ready)

    def close_extras(self, **kwargs: Any) -> None:
        """Let go of engines; the tree can be run again."""
        self.batch.close()

    # ---- those that are ready ---------------------------------------------------------------------------

    def begin(
        self,
        rows: Array,
        seed: int | Sequence[int | None] | None = None,
        draw: Sequence[int] | None = None,
    ) -> None:
        """Begin episodes in worlds ``(k,)``, whatever goes on there; `recv` gives their first decisions.

        Args:
            rows: Which worlds.
            seed: As of `reset`.
            draw: As of the options of `reset`.

        Raises:
            InputError: They are not as many as the worlds.
        """
        seeds, draws = self._seeds(seed), [None] * self.num_envs if draw is None else np.ravel(draw).tolist()
        for what, found in (("seeds", seeds), ("draws", draws)):
            if len(found) != self.num_envs:
                raise InputError(f"there are {self.num_envs} worlds, and {len(found)} {what}")
        for row in np.asarray(rows).tolist():
            if seeds[row] is not None or self._rngs[row] is None:
                self._rngs[row], _ = seeding.np_random(seeds[row])
            self._ended.pop(row, None)
            self._begin(row, draws[row])

    def send(self, rows: Array, actions: Array) -> None:
        """Give worlds that wait for one an action.

        Args:
            rows: Which ``(k,)``.
            actions: ``(k, actions + 1)``.

        Raises:
            InputError: The actions have the wrong shape or are not finite.
            RuntimeError: One of these worlds does not wait for one.
        """
        self.batch.decide(rows, actions)

    def recv(self) -> tuple[Array, Ready]:
        """Go on until a world at least waits for an action that had none before.

        Returns:
            Which worlds ``(k,)``, ascending, and what is new there; none where nothing goes on in any.

        Raises:
            InputError: Many draws in a row had no world, or the tree ended without activating the subtree.
        """
        found: dict[int, Happened] = {}
        while not found:
            happened = self.batch.go_on()
            if not happened:
                break
            failed = [event.error for event in happened if event.error is not None]
            for event in happened:
                if event.error is not None:
                    continue
                if event.ending is not None:
                    self.discarded += event.ending.discarded
                    self._ended[event.row] = event
                    self._begin(event.row)
                else:
                    self.redrawn += event.redrawn if event.paid is None else 0
                    found[event.row] = event
            if failed:
                raise failed[0]
        rows = sorted(found)
        return np.array(rows, int), self._ready([found[row] for row in rows])

    def wait(self, rows: Array) -> Ready:
        """Go on until worlds ``rows (k,)`` wait for an action, all of which are under way.

        Returns:
            What is new in all worlds ``(N, ...)``; nothing in those that have not gone on.

        Raises:
            InputError: Many draws in a row had no world, or the tree ended without activating the subtree.
            RuntimeError: One of them was given no action.
        """
        rewards, terminated = np.zeros(self.num_envs), np.zeros(self.num_envs, bool)
        truncated, missing = np.zeros(self.num_envs, bool), set(np.asarray(rows).tolist())
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        while missing:
            found, ready = self.recv()
            if not len(found):
                raise RuntimeError(f"nothing is under way in world {min(missing)}: begin(), or send(), first")
            rewards[found], terminated[found] = ready.rewards, ready.terminated
            truncated[found] = ready.truncated
            for row, info in zip(found.tolist(), ready.infos, strict=True):
                infos[row] = info
            missing -= set(found.tolist())
        return Ready(self.batch.features(), rewards, terminated, truncated, infos)

    def _ready(self, events: list[Happened]) -> Ready:
        k = len(events)
        features = np.zeros((k, *self.batch.observation_space.shape), np.float32)
        rewards, terminated, truncated = np.zeros(k), np.zeros(k, bool), np.zeros(k, bool)
        infos: list[dict[str, Any]] = []
        for i, event in enumerate(events):
            features[i] = event.features
            info: dict[str, Any] = {"reward": event.paid}
            if event.paid is None:
                info = {"draw": event.draw, "redrawn": event.redrawn}
            else:
                rewards[i] = sum(event.paid.values())
            ended = self._ended.pop(event.row, None)
            if ended is not None:
                assert ended.ending is not None and ended.paid is not None
                rewards[i], truncated[i] = sum(ended.paid.values()), ended.ending.truncated
                terminated[i] = not ended.ending.truncated
                info |= {"final_obs": ended.features, "final_info": ended.ending.info(ended.paid)}
            infos.append(info)
        return Ready(features, rewards, terminated, truncated, infos)

    def _told(self, ready: Ready) -> dict[str, Any]:
        """What is said of all worlds, in gymnasium's form."""
        infos: dict[str, Any] = {}
        for row, info in enumerate(ready.infos):
            infos = self._add_info(infos, info, row)
        return infos

    def _seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [int(seed) + k for k in range(self.num_envs)]
        return seed

    def _begin(self, row: int, draw: int | None = None) -> None:
        rng = self._rngs[row]
        assert rng is not None
        self.batch.begin(row, Draws(rng, draw, self.stream, self.stage))
