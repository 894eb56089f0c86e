#pragma once

#include <string>

#include "common/scene/scene.h"

namespace trilha {

/// The default scene of a glTF 2.0 file (Khronos Group 2021): .gltf with its buffers and images beside it or
/// inside, or .glb, told apart by its first bytes.
///
/// A mesh of glTF becomes one Mesh, its primitives' materials those of its triangles, its vertices those that
/// a triangle uses; nodes become instances, in the order in which the scene's tree is walked. Where each mesh
/// stands once, untransformed, there are no instances. What the scene does not use is neither read nor
/// checked, but for the tree of the nodes.
///
/// Materials: `diffuse` is the base colour, but for what is transmitted; `transmission` is base colour ×
/// transmission × (1 − metallic). Specular, shininess and reflection stay 0: what a Whitted ray tracer makes
/// of roughness and metallic is not the file's matter. Emission (in glTF cd/m²), lights (cd; lux) keep their
/// numbers, as W of whatever the file's candela stands for. Walls of transmitting surfaces are not thin:
/// KHR_materials_volume adds absorption, no more. Occlusion maps and tangents are not wanted by a ray tracer.
///
/// Read besides: KHR_lights_punctual, KHR_materials_emissive_strength, KHR_materials_ior,
/// KHR_materials_transmission, KHR_materials_volume, KHR_mesh_quantization, KHR_texture_transform (without
/// rotation), EXT_mesh_gpu_instancing. Left out with a warning: points and lines, morph targets, skins,
/// animations, vertex colours, further texture coordinates, orthographic cameras, other extensions that are
/// not required.
///
/// Throws InputError, with the key's line, for what is malformed, reaches beyond its buffer, requires an
/// extension that is not read, or has a node with two parents, in a circle, or with a singular transform; for
/// numbers that are not finite as floats. Limits, said before memory is taken, so that objects which share
/// their bytes do not multiply them: of triangles, vertices and elements of sparse accessors together 2 for
/// each byte of the buffers that is there, and besides 2¹⁶ and 64 for each primitive, these at most 2²⁰; of
/// instances 2²², where those of EXT_mesh_gpu_instancing count as four of the former; of elements without a
/// buffer view 2²⁰; and those of parse_json.
Scene load_gltf(const std::string& path, const LoadOptions& options = {});

}  // namespace trilha
