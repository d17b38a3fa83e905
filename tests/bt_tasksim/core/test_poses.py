"""Laws of rotations and poses, the same for one pose in NumPy, a batch in NumPy and a batch in torch."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from bt_tasksim.core import poses
from tests.array_libraries import LIBRARIES, agree

torch = pytest.importorskip("torch")

TIGHT = 1e-12
IDENTITY = poses.pose([0.0, 0.0, 0.0])
number = st.floats(-3.0, 3.0, allow_nan=False, width=64)
vectors = st.tuples(number, number, number).map(np.array)


@st.composite
def quaternions(draw):
    q = np.array([draw(number) for _ in range(4)])
    assume(np.linalg.norm(q) > 1e-2)
    return q / np.linalg.norm(q)


@st.composite
def any_pose(draw):
    return np.concatenate([draw(vectors), draw(quaternions())])


fraction = st.floats(0.0, 1.0)
law = settings(max_examples=60, deadline=None)


def scipy_rotation(q):
    return Rotation.from_quat(np.roll(q, -1))


def same_rotation(a, b, tolerance=TIGHT):
    return min(np.abs(a - b).max(), np.abs(a + b).max()) < tolerance


def same_pose(a, b, tolerance=1e-11):
    return np.abs(a[:3] - b[:3]).max() < tolerance and same_rotation(a[3:], b[3:], tolerance)


# ---- laws -------------------------------------------------------------------------------------------------


@law
@given(any_pose(), any_pose(), any_pose())
def test_poses_are_a_group(a, b, c):
    left = poses.multiply(poses.multiply(a, b), c)
    assert same_pose(left, poses.multiply(a, poses.multiply(b, c)))
    assert same_pose(poses.multiply(a, IDENTITY), a) and same_pose(poses.multiply(IDENTITY, a), a)
    assert same_pose(poses.multiply(a, poses.inverse(a)), IDENTITY)
    assert same_pose(poses.multiply(poses.inverse(a), a), IDENTITY)
    assert same_pose(poses.inverse(poses.multiply(a, b)), poses.multiply(poses.inverse(b), poses.inverse(a)))


@law
@given(any_pose(), any_pose(), vectors)
def test_composition_acts_on_points_one_after_the_other(a, b, p):
    both = poses.transform(poses.multiply(a, b), p)
    assert np.allclose(both, poses.transform(a, poses.transform(b, p)), atol=1e-11)
    assert np.allclose(poses.transform(poses.inverse(a), poses.transform(a, p)), p, atol=1e-11)


@law
@given(quaternions(), quaternions(), vectors)
def test_rotations_agree_with_scipy(a, b, v):
    assert np.allclose(poses.rotate(a, v), scipy_rotation(a).apply(v), atol=1e-12)
    product = (scipy_rotation(a) * scipy_rotation(b)).as_matrix()
    assert np.allclose(poses.to_matrix(poses.quat_multiply(a, b)), product, atol=1e-12)
    assert np.allclose(poses.to_matrix(a), scipy_rotation(a).as_matrix(), atol=1e-12)
    assert poses.angle_between(a, b) == pytest.approx(
        (scipy_rotation(a).inv() * scipy_rotation(b)).magnitude(), abs=1e-7
    )


@law
@given(quaternions(), vectors, vectors)
def test_rotations_keep_lengths_angles_and_handedness(q, u, v):
    a, b = poses.rotate(q, u), poses.rotate(q, v)
    assert np.linalg.norm(a) == pytest.approx(np.linalg.norm(u), abs=1e-11)
    assert a @ b == pytest.approx(u @ v, abs=1e-10)
    assert np.allclose(poses.cross(a, b), poses.rotate(q, poses.cross(u, v)), atol=1e-10)


# ---- round trips ------------------------------------------------------------------------------------------


@law
@given(quaternions())
def test_matrix_round_trip(q):
    assert same_rotation(poses.from_matrix(poses.to_matrix(q)), q)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("angle", [0.0, 1e-9, np.pi / 2, np.pi - 1e-9, np.pi])
def test_matrix_round_trip_at_the_hard_angles(axis, angle):
    v = np.zeros(3)
    v[axis] = angle
    q = poses.from_rotation_vector(v)
    assert same_rotation(poses.from_matrix(poses.to_matrix(q)), q)


@law
@given(quaternions())
def test_rotation_vector_round_trip(q):
    v = poses.rotation_vector(q)
    assert np.linalg.norm(v) <= np.pi + 1e-12
    assert same_rotation(poses.from_rotation_vector(v), q)
    assert np.allclose(poses.rotation_vector(-q), v, atol=1e-9) or np.linalg.norm(v) > np.pi - 1e-6


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-14, 1e-9, 1e-6, 1.0, 3.14])
def test_rotation_vectors_of_every_size(size):
    v = size * np.array([2.0, -1.0, 2.0]) / 3.0
    assert np.allclose(poses.rotation_vector(poses.from_rotation_vector(v)), v, rtol=1e-9, atol=1e-300)


@law
@given(vectors, vectors)
def test_frame_from_axes(z, y):
    assume(np.linalg.norm(z) > 0.1 and np.linalg.norm(np.cross(z, y)) > 0.1)
    m = poses.to_matrix(poses.frame_from_axes(z, y))
    assert np.allclose(m[:, 2], z / np.linalg.norm(z), atol=1e-12)
    assert m[:, 1] @ y > 0 and abs(m[:, 0] @ y) < 1e-10
    assert np.linalg.det(m) == pytest.approx(1.0)


@law
@given(quaternions(), st.sampled_from([1.0, -1.0, 0.0]), vectors)
def test_the_shortest_turn_of_a_direction_onto_another(q, same, v):
    """Also of what points the same way already, or straight away."""
    a, other = (poses.rotate(q, np.array(axis)) for axis in ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
    assume(np.linalg.norm(v) > 0.1)
    b = same * a if same else poses.unit(v)
    for turn in (poses.shortest_turn(a, b), poses.shortest_turn(a, b, other)):
        assert np.allclose(poses.rotate(poses.from_rotation_vector(turn), a), b, atol=1e-8)
        assert np.linalg.norm(turn) == pytest.approx(
            np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b), abs=1e-8
        )
        assert abs(turn @ a) < 1e-7
    if same < 0.0:
        assert np.allclose(turn, np.pi * other, atol=1e-7)


@law
@given(any_pose(), any_pose(), fraction)
def test_interpolation(a, b, f):
    assert same_pose(poses.interpolate(a, b, 0.0), a)
    assert same_pose(poses.interpolate(a, b, 1.0), b)
    middle = poses.interpolate(a, b, f)
    assert np.allclose(middle[:3], (1 - f) * a[:3] + f * b[:3])
    whole = poses.angle_between(a[3:], b[3:])
    assume(whole < np.pi - 1e-3)  # beyond, either way round is the shortest
    assert poses.angle_between(a[3:], middle[3:]) == pytest.approx(f * whole, abs=1e-6)
    assert np.linalg.norm(middle[3:]) == pytest.approx(1.0)


# ---- one, a batch, torch ----------------------------------------------------------------------------------

Q, V, P = slice(3, 7), slice(0, 3), slice(0, 7)
FUNCTIONS = {
    "quat_multiply": (poses.quat_multiply, Q, Q),
    "quat_conjugate": (poses.quat_conjugate, Q),
    "rotate": (poses.rotate, Q, V),
    "multiply": (poses.multiply, P, P),
    "inverse": (poses.inverse, P),
    "relative": (poses.relative, P, P),
    "localise": (poses.localise, P, V),
    "shifted": (poses.shifted, P, V),
    "unit": (poses.unit, V),
    "norm": (poses.norm, P),
    "dot": (poses.dot, Q, Q),
    "tilt": (poses.tilt, Q),
    "tilt against another": (poses.tilt, Q, Q),
    "apply": (lambda q, v: poses.apply(poses.to_matrix(q), v), Q, V),
    "transform": (poses.transform, P, V),
    "normalise": (lambda q: poses.normalise(3.0 * q), Q),
    "rotation_vector": (poses.rotation_vector, Q),
    "from_rotation_vector": (poses.from_rotation_vector, V),
    "angle_between": (poses.angle_between, Q, Q),
    "cross": (poses.cross, V, V),
    "to_matrix": (poses.to_matrix, Q),
    "from_matrix": (lambda q: poses.from_matrix(poses.to_matrix(q)), Q),
    "frame_from_axes": (poses.frame_from_axes, V, V),
    "shortest_turn": (lambda a, b: poses.shortest_turn(poses.unit(a), poses.unit(b)), V, V),
    "interpolate": (lambda a, b: poses.interpolate(a, b, abs(a[..., 0]) / 3.0), P, P),
    "interpolate by one share": (lambda a, b: poses.interpolate(a, b, 0.3), P, P),
    "z_axis": (poses.z_axis, Q),
    "clip": (lambda v: poses.clip(v, [-1.0, -2.0, 0.0], 1.0), V),
}


@settings(max_examples=12, deadline=None)
@pytest.mark.parametrize("name", FUNCTIONS)
@given(st.integers(0, 10**6))
def test_one_batch_and_torch_compute_the_same(name, seed):
    function, *parts = FUNCTIONS[name]
    rng = np.random.default_rng(seed)
    batch = rng.uniform(-3.0, 3.0, (len(parts), 2, 3, 7))
    batch[..., 3:] = poses.normalise(batch[..., 3:])
    before = batch.copy()
    arguments = [batch[i][..., part] for i, part in enumerate(parts)]
    whole = function(*arguments)
    in_torch = function(*(torch.from_numpy(a.copy()) for a in arguments))
    single = function(*(torch.from_numpy(a.astype(np.float32)) for a in arguments))
    assert np.array_equal(batch, before), "an argument was changed"
    assert in_torch.dtype == torch.float64 and single.dtype == torch.float32
    for index in np.ndindex(2, 3):
        one = function(*(a[index] for a in arguments))
        assert np.allclose(one, whole[index], rtol=0, atol=TIGHT)
        assert np.allclose(one, in_torch[index].numpy(), rtol=0, atol=TIGHT)
    if name != "from_matrix":  # its sign may flip where two candidates are equally long
        assert np.allclose(whole, single.numpy(), rtol=0, atol=2e-5)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_row_is_the_same_bits_in_any_company_and_however_it_lies_in_memory(rows_alike, name):
    function, *parts = FUNCTIONS[name]
    batch = np.random.default_rng(4).uniform(-3.0, 3.0, (len(parts), 65, 7))
    batch[..., 3:] = poses.normalise(batch[..., 3:])
    slices = [batch[i][..., part] for i, part in enumerate(parts)]
    copies = [np.ascontiguousarray(part) for part in slices]
    columns = [np.asfortranarray(part) for part in slices]
    spread = [np.repeat(part, 2, axis=-1)[..., ::2] for part in slices]
    whole = rows_alike(lambda rows: function(*(part[rows] for part in slices)), 65)
    for lying in (slices, copies, columns, spread):
        assert np.array_equal(function(*lying), whole)
        for k in range(0, 65, 6):
            assert np.array_equal(function(*(part[k : k + 1] for part in lying)), whole[k : k + 1])


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_library_and_device_gives_the_same(name):
    function, *parts = FUNCTIONS[name]
    batch = np.random.default_rng(6).uniform(-3.0, 3.0, (len(parts), 65, 7))
    batch[..., 3:] = poses.normalise(batch[..., 3:])
    batch[:, 0, 3:] = IDENTITY[3:]
    if name != "tilt against another":  # an arc cosine near 1 has no more digits
        batch[:, 1, 3:] = IDENTITY[[4, 3, 5, 6]]
    agree(function, *(batch[i][..., part] for i, part in enumerate(parts)), single_close=None)


class OnAnotherDevice(torch.Tensor):
    """A tensor into which NumPy cannot look, as one on a GPU."""

    def __array__(self, *_, **__):
        raise TypeError("can't convert a device tensor to numpy")

    def __dlpack__(self, *_, **__):
        raise BufferError("unsupported device")

    def to(self, device):
        assert device == "cpu"
        return self.as_subclass(torch.Tensor)


def test_an_array_is_brought_to_numpy_from_wherever_it_is():
    for values in (np.arange(3.0), np.array([True, False]), np.arange(2), np.float32(0.5)):
        assert poses.host(values).dtype == values.dtype
        for put in LIBRARIES.values():
            found = poses.host(put(values))
            assert type(found) is np.ndarray and found.dtype == values.dtype
            assert np.array_equal(found, values)
    far = torch.arange(3.0).as_subclass(OnAnotherDevice)
    assert np.array_equal(poses.host(far), [0.0, 1.0, 2.0])
    same = np.arange(3.0)
    assert poses.host(same) is same and poses.host(True) == np.array(True)


def test_relative_and_localise_are_what_their_names_say():
    a, b = np.random.default_rng(5).normal(size=(2, 20, 7))
    a[:, 3:], b[:, 3:] = poses.normalise(a[:, 3:]), poses.normalise(b[:, 3:])
    assert np.allclose(poses.relative(a, b), poses.multiply(poses.inverse(a), b), atol=1e-12)
    assert np.allclose(poses.localise(a, poses.transform(a, b[:, :3])), b[:, :3], atol=1e-12)
    moved = poses.shifted(a, b[:, :3])
    assert np.array_equal(moved[:, :3], a[:, :3] + b[:, :3]) and np.array_equal(moved[:, 3:], a[:, 3:])


def test_batch_dimensions_broadcast():
    q = poses.normalise(np.random.default_rng(0).normal(size=(5, 1, 4)))
    v = np.random.default_rng(1).normal(size=(3, 3))
    out = poses.rotate(q, v)
    assert out.shape == (5, 3, 3)
    assert np.allclose(out[4, 2], poses.rotate(q[4, 0], v[2]))


def test_yaw_and_pose():
    assert np.allclose(poses.rotate(poses.yaw(np.pi / 2), np.array([1.0, 0, 0])), [0, 1, 0])
    assert poses.pose([1, 2, 3]).tolist() == [1, 2, 3, 1, 0, 0, 0]
    assert poses.pose([1, 2, 3]).dtype == float


# ---- axes -------------------------------------------------------------------------------------------------


@law
@given(quaternions(), quaternions())
def test_tilt_is_the_angle_between_z_axes_whatever_the_heading(a, b):
    up = poses.z_axis(a)
    assert np.abs(up - scipy_rotation(a).as_matrix()[:, 2]).max() < TIGHT
    angle = np.arccos(np.clip(up[2], -1.0, 1.0))
    assert float(poses.tilt(a)) == pytest.approx(angle, abs=1e-7)
    between = np.arccos(np.clip(poses.z_axis(b) @ up, -1.0, 1.0))
    assert float(poses.tilt(a, b)) == pytest.approx(between, abs=1e-7)
    turned = poses.quat_multiply(a, poses.yaw(1.3))
    assert float(poses.tilt(turned)) == pytest.approx(float(poses.tilt(a)), abs=1e-7)
    both, others = np.stack([a, b]), np.stack([b, a])
    assert poses.tilt(both, others) == pytest.approx([between, between], abs=1e-7)
    assert poses.tilt(torch.from_numpy(both)).numpy() == pytest.approx(poses.tilt(both), abs=1e-7)


def test_a_pose_of_a_few_digits_is_brought_to_unit_length():
    pose = poses.unit_pose([1, 2, 3, 0.707, 0.707, 0.0, 0.0])
    assert pose[:3].tolist() == [1, 2, 3] and np.linalg.norm(pose[3:]) == pytest.approx(1.0, abs=1e-15)
