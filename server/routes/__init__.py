"""The routes: one module with a `router` for each topic. `server/app.py` lists them.

The guard decides access (`server.gateway.rules`): a viewer may read. `services_of(request)` returns
all services. Requests that touch the learner go through `robot.loop.submit`. See
docs/reference/http.md.
"""
