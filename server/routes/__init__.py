"""The routes, one module for each topic, and each with a `router` (`server/app.py` has the list).

The guard decides access (`server.gateway.rules`): a viewer may read. `services_of(request)` returns
all services. Requests that touch the learner go through `robot.loop.submit`. See
docs/reference/http.md.
"""
