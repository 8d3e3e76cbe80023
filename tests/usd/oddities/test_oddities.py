"""What real stages do, row by row, and the test that shows each oddity right.

| row | oddity | test |
| --- | --- | --- |
| 1 | composition errors of `.mtlx` references | materials: test_a_materialx_reference_is_a_warning |
| 1 | dangling bindings | materials: test_a_dangling_binding_shows_grey_and_is_named |
| 2 | materials without UsdPreviewSurface | materials: test_a_material_without_preview_surface_says_what_it_has |
| 2 | gprims without material | materials: test_a_gprim_without_material_is_grey |
| 2 | displayColor only: constant, uniform, vertex, faceVarying | materials: test_display_color_is_read_back |
| 3 | bindings only for purpose full | materials: test_a_binding_for_purpose_full_only |
| 4 | light only from emissive meshes | stages: test_light_from_an_emissive_mesh_only |
| 4 | no light at all | stages: test_a_stage_without_light_gets_the_stated_one |
| 5 | instance proxies | stages: test_the_painted_instance_changes_alone |
| 5 | PointInstancers with animated points | stages: test_a_point_instancer_with_animated_points |
| 5 | hundreds of thousands of triangles | stages: test_hundreds_of_thousands_of_instanced_triangles |
| 6 | variants that replace the overridden prim | materials: test_a_variant_that_replaces_the_painted_prim |
| 6 | one material on many meshes | materials: test_one_material_on_many_meshes |
| 7 | UsdUVTexture without st input | textures: test_a_texture_without_st_input_reads_st |
| 7 | map1, UVMap, st_faceVarying; float2[] or texCoord2f[]; indexed or not; vertex or faceVarying | \
textures: test_texture_coordinates_of_any_name_and_kind |
| 7 | the same, solved | textures: test_odd_texture_coordinates_solve_to_a_scale |
| 7 | no texture coordinates | textures: test_absent_texture_coordinates_show_one_texel_and_are_named |
| 8 | Blender's non-schema inputs | materials: test_inputs_that_are_not_of_the_schema_are_left |
| 9 | unauthored subdivisionScheme is catmullClark | geometry: test_no_scheme_is_catmull_clark |
| 9 | even on a huge cage | geometry: test_a_huge_cage_is_read_as_it_is_and_said |
| 9 | loop | geometry: test_loop_subdivision |
| 9 | creases | geometry: test_creases_keep_a_cube_a_cube |
| 10 | leftHanded winding | geometry: test_left_handed_faces_point_outward |
| 10 | the same, solved | geometry: test_left_handed_floor_solves |
| 10 | no normals | geometry: test_no_normals_are_those_of_the_faces |
| 10 | `normals` | geometry: test_normals_attribute_is_used |
| 10 | `primvars:normals` beside `normals` | geometry: test_normals_primvar_wins |
| 11 | thousands of degenerate triangles | geometry: test_thousands_of_degenerate_triangles |
| 12 | GeomSubsets with empty family | materials: test_subsets_without_a_family_bind |
| 13 | metersPerUnit unauthored | stages: test_no_meters_per_unit_is_a_centimetre |
| 13 | metersPerUnit absurd | stages: test_absurd_meters_per_unit_change_nothing |
| 13 | Y-up and Z-up | stages: test_both_up_axes |
| 14 | normalize, and colour temperature enabled without one | \
stages: test_colour_temperature_without_a_temperature_is_6500 |
| 15 | no defaultPrim | stages: test_no_default_prim |
| 15 | cameras outside the defaultPrim | stages: test_a_camera_outside_the_default_prim |
| 16 | pivots, !invert! and suffixes | geometry: test_pivots_inverses_and_suffixes |
| 16 | resetXformStack | geometry: test_reset_xform_stack |
| 17 | only Sphere, Cube, ... gprims | geometry: test_a_stage_of_implicit_gprims_only |
| 18 | Ptex files | textures: test_ptex_shows_its_fallback_and_is_named |
| 18 | Ptex nodes | textures: test_a_ptex_node_is_named_and_its_input_has_the_fallback |
| 18 | UDIM | textures: test_udim_tiles_lie_side_by_side |
| 18 | absolute paths | textures: test_an_absolute_path_is_read_and_not_written |
| 18 | missing textures | textures: test_a_missing_texture_shows_its_fallback_and_is_named |
| 18 | the same, from the command line | textures: test_strokes_of_a_layer_are_solved_over_a_missing_texture |
| 19 | crate files too old to open | stages: test_a_crate_that_is_too_old_is_one_sentence |
| 19 | referenced ones | stages: test_a_reference_to_a_crate_that_is_too_old_is_a_warning |
| 20 | concave n-gons | geometry: test_a_concave_polygon_covers_its_area_once |
| 20 | n-gons that are not flat | geometry: test_a_polygon_that_is_not_flat_keeps_its_corners |
| 20 | holes | geometry: test_holes_are_seen_through |
| 20 | time samples outside the stage range | stages: test_time_samples_outside_the_range_of_the_stage |
| 20 | skinned meshes | stages: test_a_skinned_floor_solves_in_its_pose |
"""

from __future__ import annotations

from importlib import import_module

ROWS = range(1, 21)
SUBJECTS = ("geometry", "materials", "stages", "textures")


def table() -> list[tuple[int, str, str, str]]:
    """Row, oddity, subject and test of each line of the table above."""
    assert __doc__ is not None
    lines = [line for line in __doc__.splitlines() if line.startswith("| ")][2:]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [(int(row), oddity, *test.split(": ")) for row, oddity, test in cells]  # type: ignore[misc]


def test_each_row_has_a_test() -> None:
    assert {row for row, *_ in table()} == set(ROWS)


def test_the_tests_of_the_table_are_all_that_there_are() -> None:
    """Each named test exists in its module, and each test of the modules is named."""
    named = {(subject, test) for _, _, subject, test in table()}
    modules = {s: import_module(f"test_oddities_{s}") for s in SUBJECTS}
    there = {(s, name) for s, m in modules.items() for name in vars(m) if name.startswith("test_")}
    assert named == there
    assert all(callable(getattr(modules[s], name)) for s, name in there)
    assert len(table()) == len(named)
