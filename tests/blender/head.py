"""Blender opens a GLB of the head: blender -b --python head.py -- head.glb FPS
FRAME.. writes, for each frame, where the vertices are in the camera's space
(frame-N.npy, metres, glTF's axes) and a picture through the file's camera
(frame-N.png, 256 by 256) in which every surface has the colour of its place;
shapes.txt: each shape key and how far it moves a vertex, in metres."""
import sys

import numpy

numpy.bool = bool               # which the add-on of Debian's 3.4.1 still names
import bpy

glb, fps, *frames = sys.argv[sys.argv.index("--") + 1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = int(fps)
bpy.ops.import_scene.gltf(filepath=glb)
camera = next(o for o in bpy.data.objects if o.type == "CAMERA")
head = next(o for o in bpy.data.objects if o.type == "MESH" and o.data.shape_keys)


def places():
    """The vertices, posed, in the camera's space."""
    posed = head.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = posed.to_mesh()
    x = numpy.empty(3 * len(mesh.vertices), "f4")
    mesh.vertices.foreach_get("co", x)
    posed.to_mesh_clear()
    world = camera.matrix_world.inverted() @ posed.matrix_world
    m = numpy.array(world, "f8")
    return x.reshape(-1, 3) @ m[:3, :3].T + m[:3, 3]


# Emission of 0.5 + 4 (x, y, z - middle): no light, no texture.
material = bpy.data.materials.new("place")
material.use_nodes = True
tree = material.node_tree
tree.nodes.clear()
colour = tree.nodes.new("ShaderNodeVertexColor")
colour.layer_name = "place"
emission = tree.nodes.new("ShaderNodeEmission")
output = tree.nodes.new("ShaderNodeOutputMaterial")
tree.links.new(colour.outputs["Color"], emission.inputs["Color"])
tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
head.data.materials.clear()
head.data.materials.append(material)
layer = head.data.color_attributes.new("place", "FLOAT_COLOR", "POINT")

scene.camera = camera
scene.render.engine = "CYCLES"
scene.cycles.samples = 32
scene.cycles.use_denoising = False
scene.render.resolution_x = scene.render.resolution_y = 256
scene.render.filter_size = 1
scene.view_settings.view_transform = "Raw"
scene.world = bpy.data.worlds.new("black")
scene.world.color = (0, 0, 0)
for frame in frames:
    scene.frame_set(int(frame))
    x = places()
    numpy.save(f"frame-{frame}.npy", x)
    middle = (x.min(0) + x.max(0)) / 2
    rgba = numpy.ones((len(x), 4), "f4")
    rgba[:, :3] = 0.5 + 3 * (x - middle)
    layer.data.foreach_set("color", rgba.ravel())
    scene.render.filepath = f"//frame-{frame}.png"
    scene.render.filepath = bpy.path.abspath(f"./frame-{frame}.png")
    bpy.ops.render.render(write_still=True)

head.animation_data_clear()
head.data.shape_keys.animation_data_clear()
keys = head.data.shape_keys.key_blocks
for key in keys[1:]:
    key.value = 0
bpy.context.view_layer.update()
rest = places()
with open("shapes.txt", "w") as out:
    for key in keys[1:]:
        key.value = 1
        bpy.context.view_layer.update()
        moved = numpy.linalg.norm(places() - rest, axis=1).max()
        out.write(f"{key.name} {moved:.6f}\n")
        key.value = 0
