"""Caches the learned images for the page's gallery.

The cache asks the learner only when a client asks, and keeps the images until something is taught
or changed.
"""

from __future__ import annotations

import asyncio
import math

from robot.coaching.gallery import LearnedImage, images
from robot.control.loop import ControlLoop
from robot.policy.policy import Policy

_REMEMBERED = 512
"""Maximum number of cached images that the learner has since merged into others."""
_REFRESH_S = 0.4
"""Minimum time between two fetches of the gallery while the robot learns, in seconds."""


class Gallery:
    """The learned images of one robot, for the routes."""

    def __init__(self, loop: ControlLoop) -> None:
        self._loop = loop
        self._policy: Policy | None = None
        self._images: list[LearnedImage] = []
        self._seen: dict[int, LearnedImage] = {}
        self._n_seen = 0
        self._fetched_s, self._fetched_changes = -math.inf, -1

    async def images(self, *, fresh: bool = False) -> list[LearnedImage]:
        """Return the learned images; `fresh` skips the cache."""
        now_s, changes = self._loop.clock.now_s(), self._loop.history.changes
        is_stale = changes != self._fetched_changes
        if fresh or (is_stale and now_s - self._fetched_s > _REFRESH_S):
            self._fetched_s, self._fetched_changes = now_s, changes
            policy, self._n_seen, self._images = await asyncio.wrap_future(
                self._loop.submit(self._fetch)
            )
            if policy is not self._policy:  # a new learner numbers its images from 0 again
                self._policy, self._seen = policy, {}
            shown = {image.node_id: image for image in self._images}
            before = [one for one in self._seen.items() if one[0] not in shown]
            self._seen = dict(before[-max(_REMEMBERED, len(shown)) :]) | shown
        return self._images

    async def image(self, node: int) -> LearnedImage | None:
        """Return a learned image, or its last version if it has been merged since.

        A client requests images from an earlier list, and each example can merge some of them; for
        a merged image, its last version is the best answer. If no request had listed the image
        before the merge, return the most recently used image. Return None if no image ever had the
        number `node`.
        """
        await self.images()
        if node not in self._seen:
            await self.images(fresh=True)
        if node not in self._seen and 0 <= node < self._n_seen:  # an id is an example's number
            return max(self._images, key=lambda image: image.last_used, default=None)
        return self._seen.get(node)

    def _fetch(self) -> tuple[Policy, int, list[LearnedImage]]:
        policy = self._loop.history.policy
        return policy, policy.n_seen, images(policy)
