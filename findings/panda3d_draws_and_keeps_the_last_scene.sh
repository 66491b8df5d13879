#!/bin/sh
# panda3d 1.10.16 (TinyDisplay): a window keeps the textures of the last scene that it drew, even after the scene was
# removed.
#
# Guess before running: a texture has no other owner left once its node is removed and the camera looks at nothing.
# Outcome: wrong. The window's state guardian keeps the last render state, and with it the texture, until a frame of
# another scene with another texture is drawn. Frames without any shape do not free it. A program with two windows,
# for two picture sizes, keeps two scenes.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet panda3d==1.10.16
"$folder/env/bin/python" - <<'EOF'
from panda3d import core

core.loadPrcFileData("", "notify-level error\naudio-library-name null\ngarbage-collect-states 0\n")
pipe = core.GraphicsPipeSelection.getGlobalPtr().makePipe("TinyOffscreenGraphicsPipe", "p3tinydisplay")
engine = core.GraphicsEngine(pipe)
window = engine.makeOutput(
    pipe, "w", 0, core.FrameBufferProperties(), core.WindowProperties.size(64, 64),
    core.GraphicsPipe.BFRefuseWindow,
)
region = window.makeDisplayRegion()


def scene(shade):
    root = core.NodePath("scene")
    camera = root.attachNewNode(core.Camera("camera", core.PerspectiveLens()))
    maker = core.CardMaker("card")
    maker.setFrame(-1, 1, -1, 1)
    card = root.attachNewNode(maker.generate())
    card.setPos(0, 5, 0)
    texture = core.Texture(f"shade {shade}")
    texture.setup2dTexture(8, 8, core.Texture.TUnsignedByte, core.Texture.FRgb)
    texture.setRamImage(bytes([shade]) * 192)
    card.setTexture(texture)
    return root, camera, texture


def draw(camera):
    region.setCamera(camera)
    engine.renderFrame()


root, camera, texture = scene(10)
for _ in range(3):
    draw(camera)
region.setCamera(core.NodePath())
root.removeNode()
del camera
removed = texture.getRefCount()
for _ in range(5):
    engine.renderFrame()
empty = texture.getRefCount()
other_root, other_camera, other = scene(20)
for _ in range(2):
    draw(other_camera)
after = texture.getRefCount()
print("owners of the texture: scene removed", removed, "- empty frames", empty, "- another scene", after)
assert removed > 1 and empty > 1 and after == 1
EOF
