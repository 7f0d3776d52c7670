# SPDX-License-Identifier: MIT
"""numpy arrays: read and written in place, checked, and never out of bounds."""
import gc

import membrane
import numpy
import pytest


@pytest.fixture
def scene():
    class Scene:
        mesh = membrane.icosphere(subdivisions=2)
        network = membrane.MassSpringNetwork(mesh, stiffness=40.0)
        foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0)
        solver = membrane.QuasiStaticSolver(network)
        x = mesh.positions.copy()
        pull = membrane.pull(0, mesh.positions[0] * 1.2)

        def step(self, x):
            return self.solver.step(x, 1e-3, self.network, self.foundation, self.pull)

    return Scene()


def test_positions_are_moved_in_place(scene):
    before = scene.x.copy()
    address = scene.x.ctypes.data
    report = scene.step(scene.x)
    assert report.status == membrane.StepStatus.advanced and scene.x.ctypes.data == address
    changed = numpy.flatnonzero((scene.x != before).any(axis=1))
    assert set(changed) == set(report.moved) and len(changed) > 1
    assert numpy.array_equal(scene.x[0], scene.mesh.positions[0] * 1.2)


def test_rows_of_a_larger_array_are_moved_in_place(scene):
    interleaved = numpy.zeros((scene.mesh.vertex_count, 8))
    interleaved[:, :3] = scene.mesh.positions
    interleaved[:, 3:] = 7
    scene.step(interleaved[:, :3])
    alone = scene.mesh.positions.copy()
    scene.solver.reset()
    scene.step(alone)
    assert numpy.array_equal(interleaved[:, :3], alone) and (interleaved[:, 3:] == 7).all()


@pytest.mark.parametrize("wrong", [
    lambda x: x.astype(numpy.float32), lambda x: x.tolist(), lambda x: x.T, lambda x: x[:, :2], lambda x: x.ravel(),
    lambda x: numpy.asfortranarray(x), lambda x: x[::-1], lambda x: x.astype(">f8"),
])
def test_other_arrays_are_refused_not_copied(scene, wrong):
    with pytest.raises(TypeError, match="float64, V x 3"):
        scene.step(wrong(scene.x))


def test_an_array_that_may_not_be_written_is_refused(scene):
    with pytest.raises(TypeError, match="writeable"):
        scene.step(scene.mesh.positions)


def test_another_number_of_vertices_is_refused(scene):
    with pytest.raises(membrane.InvalidInput, match="x must have 162 vertices, got 161"):
        scene.step(scene.x[:-1])
    other = membrane.icosphere(subdivisions=1)
    tool = membrane.Tool(position=(0, 0, 0.01), radius=1e-3)
    tree, tracker = membrane.AabbTree(other), membrane.ContactTracker(other)
    contact = tracker.update(tree, other.positions, tool)
    with pytest.raises(membrane.InvalidInput, match="the contact must have 162 vertices, got 42"):
        scene.solver.step(scene.x, 1e-3, scene.network, scene.foundation, membrane.press(tool, contact))
    with pytest.raises(membrane.InvalidInput, match="the foundation must have 162"):
        scene.solver.step(scene.x, 1e-3, scene.network, membrane.VirtualVolumeSprings(other, stiffness=1.0))
    with pytest.raises(membrane.InvalidInput, match="the network must have 162"):
        scene.solver.step(scene.x, 1e-3, membrane.MassSpringNetwork(other, stiffness=1.0), scene.foundation)
    with pytest.raises(membrane.InvalidInput, match="the tree must have 162"):
        membrane.ContactTracker(scene.mesh).update(tree, scene.x, tool)


@pytest.mark.parametrize("part", [membrane.AabbTree, membrane.VertexNormals])
def test_moved_vertices_are_checked(scene, part):
    made = part(scene.mesh)
    call = made.refit if part is membrane.AabbTree else made.update
    call(scene.x, numpy.array([0, 161], dtype=numpy.int32))
    for wrong in (-1, 162):
        with pytest.raises(membrane.InvalidInput, match="moved vertices must be 0 to 161"):
            call(scene.x, numpy.array([wrong], dtype=numpy.int32))
    with pytest.raises(TypeError):
        call(scene.x, numpy.array([0.5]))
    call(scene.x, scene.step(scene.x))  # a report in place of its array


def test_views_keep_what_they_show():
    positions = membrane.icosphere(subdivisions=1).positions
    gc.collect()
    assert numpy.allclose(numpy.linalg.norm(positions, axis=1), 0.01, rtol=1e-12)
    with pytest.raises(ValueError):
        positions[0, 0] = 1


def test_a_report_outlives_its_solver(scene):
    moved = scene.step(scene.x).moved
    expected = moved.copy()
    type(scene).solver = None
    gc.collect()
    assert numpy.array_equal(moved, expected)


def test_indices_that_are_no_vertices_refuse_the_step(scene):
    for vertex in (-1, 162, 10**6):
        for constraint in (membrane.pull(vertex, (0, 0, 1)), membrane.pin([vertex]),
                           membrane.load((0, 1, vertex), (1, 0, 0), (0, 0, 1))):
            report = scene.solver.step(scene.x, 1e-3, scene.network, scene.foundation, constraint)
            assert report.status == membrane.StepStatus.invalid_input and len(report.moved) == 0


def test_constraints_are_constraints_and_not_more_than_sixteen(scene):
    with pytest.raises(TypeError, match="press, pull, load and pin"):
        scene.solver.step(scene.x, 1e-3, scene.network, scene.foundation, 7)
    pins = [membrane.pin([v]) for v in range(17)]
    assert len(scene.solver.step(scene.x, 1e-3, scene.network, scene.foundation, *pins[:16]).reactions) == 16
    with pytest.raises(membrane.InvalidInput, match="at most 16 constraints, got 17"):
        scene.solver.step(scene.x, 1e-3, scene.network, scene.foundation, *pins)
