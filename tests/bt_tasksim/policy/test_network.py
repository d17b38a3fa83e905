"""The network: shapes, the same function in NumPy and torch, and nothing damaged is taken."""

import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core.errors import InputError
from bt_tasksim.policy.network import CLIP, Network
from tests.array_libraries import agree


def network(inputs=5, hidden=(8, 7), outputs=3, seed=0):
    rng = np.random.default_rng(seed)
    sizes = [inputs, *hidden, outputs]
    layers = [(rng.normal(size=(b, a)) / np.sqrt(a), rng.normal(size=b)) for a, b in pairwise(sizes)]
    return Network(rng.normal(size=inputs), rng.uniform(0.1, 2.0, inputs), layers)


NETWORKS = st.builds(
    network,
    inputs=st.integers(1, 40),
    hidden=st.lists(st.integers(1, 64), max_size=3).map(tuple),
    outputs=st.integers(1, 9),
    seed=st.integers(0, 10**6),
)


@given(NETWORKS, st.integers(0, 9), st.integers(0, 10**6))
@settings(deadline=None, max_examples=60)
def test_a_row_of_a_batch_is_the_same_bits_alone(rows_alike, net, worlds, seed):
    x = np.random.default_rng(seed).normal(size=(worlds, net.inputs)) * 3.0
    out = rows_alike(lambda rows: net(x[rows]), worlds)
    assert out.shape == (worlds, net.outputs) and out.dtype == np.float32
    assert np.array_equal(net(np.asfortranarray(x)), out), "however it lies in memory"


@given(NETWORKS, st.sampled_from([(), (1,), (5,), (2, 3)]), st.integers(0, 10**6))
@settings(deadline=None, max_examples=60)
def test_every_library_and_device_agrees(net, batch, seed):
    x = np.random.default_rng(seed).normal(size=(*batch, net.inputs)) * 3.0
    out = agree(net, x, close=1e-5, single_close=1e-5)
    assert out.shape == (*batch, net.outputs)


def test_it_is_what_torch_calls_a_multilayer_perceptron():
    torch = pytest.importorskip("torch")
    net, parts = network(), []
    for k, (w, b) in enumerate(net.layers):
        layer = torch.nn.Linear(w.shape[1], w.shape[0])
        layer.load_state_dict({"weight": torch.from_numpy(w), "bias": torch.from_numpy(b)})
        parts += [layer, torch.nn.Tanh()] if k < len(net.layers) - 1 else [layer]
    x = np.random.default_rng(1).normal(size=(20, 5)).astype(np.float32)
    with torch.no_grad():
        expected = torch.nn.Sequential(*parts)(torch.from_numpy(net.normalise(x))).numpy()
    assert net(x) == pytest.approx(expected, abs=1e-5)


def test_features_are_normalised_and_cut_off():
    net = Network([1.0, 0.0, 0.0], [2.0, 0.0, 1.0], [(np.eye(3), np.zeros(3))])
    assert net([3.0, 0.0, 0.0] * np.ones(3)) == pytest.approx([1.0, 0.0, 0.0])
    assert net(np.array([1.0, 1.0, -1e9])) == pytest.approx([0.0, CLIP, -CLIP]), "no division by zero"


@given(NETWORKS)
@settings(deadline=None, max_examples=20)
def test_its_arrays_make_it_again(net):
    again = Network.from_arrays(net.arrays())
    assert all((again.arrays()[k] == v).all() for k, v in net.arrays().items())
    assert (again.inputs, again.outputs) == (net.inputs, net.outputs)


def test_the_noise_of_its_signal_is_kept():
    net = network()
    noisy = Network(net.mean, net.std, net.layers, 0.25)
    assert Network.from_arrays(noisy.arrays()).signal_std == 0.25
    assert net.signal_std == 0.0 and "signal_deviation" not in net.arrays()


def without(name):
    return lambda arrays: arrays.pop(name)


def put(name, value):
    return lambda arrays: arrays.update({name: value})


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (without("mean"), "such as 'mean'"),
        (without("layer1.bias"), "such as 'layer1.bias'"),
        (without("layer0.weight"), "do not fit together, such as 'layer"),
        (put("extra", np.zeros(2)), "such as 'extra'"),
        (lambda arrays: arrays.clear(), "such as"),
        (put("deviation", np.ones(4)), r"mean \(5,\) and std \(4,\) differ"),
        (put("mean", np.ones((5, 1))), r"mean \(5, 1\) and std \(5,\) differ"),
        (put("layer1.weight", np.ones((7, 9))), r"layer 1 has weights \(7, 9\) after 8 inputs"),
        (put("layer0.bias", np.ones(3)), r"layer 0 has weights \(8, 5\) after 5 inputs, bias \(3,\)"),
        (put("layer0.weight", np.ones(8)), r"layer 0 has weights \(8,\)"),
        (put("layer2.bias", np.array([0, np.nan, 0])), "not finite"),
        (put("mean", np.array([0, 0, np.inf, 0, 0])), "not finite"),
        (put("signal_deviation", np.ones(2)), "should be one number"),
        (put("signal_deviation", np.array([-0.1])), "negative"),
        (put("signal_deviation", np.array([np.nan])), "not finite"),
    ],
)
def test_wrong_arrays_are_refused(change, sentence):
    arrays = dict(network().arrays())
    change(arrays)
    with pytest.raises(InputError, match=sentence):
        Network.from_arrays(arrays)


def test_a_network_without_layers_is_refused():
    with pytest.raises(InputError, match="at least one layer"):
        Network(np.zeros(2), np.ones(2), [])


def test_it_needs_no_torch():
    code = (
        "import sys; sys.modules['torch'] = None\n"
        "import numpy as np; from bt_tasksim.policy.network import Network\n"
        "print(Network(np.zeros(2), np.ones(2), [(np.ones((1, 2)), np.zeros(1))])(np.array([1.0, 2.0])))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[3.]"


@pytest.mark.parametrize("library", ["numpy", "torch"])
def test_what_a_row_comes_to_does_not_depend_on_the_others(library):
    features = np.random.default_rng(0).normal(size=(257, 5)).astype(np.float32)
    if library == "torch":
        features = pytest.importorskip("torch").as_tensor(features)
    whole = network()(features)
    for k in (0, 1, 100, 256):
        assert (network()(features[k : k + 1])[0] == whole[k]).all()
