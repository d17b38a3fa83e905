"""What is read and noted on the device: kernels over contacts and worlds.

Contacts of all worlds lie in one list, in no stated order on a GPU. ``link``, ``tip``, ``thing`` and ``body``
say of each geom what it belongs to (see `bt_tasksim.engines.physics.warp_batch.geoms.GeomTable`), -1 for
nothing.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def copy_rows(
    source: wp.array2d(dtype=wp.int32),
    source_rows: wp.array(dtype=wp.int32),
    target: wp.array2d(dtype=wp.int32),
    target_rows: wp.array(dtype=wp.int32),
):
    """Rows of words from one array into rows of another."""
    i, j = wp.tid()
    target[target_rows[i], j] = source[source_rows[i], j]


@wp.kernel
def put_back(
    going: wp.array(dtype=wp.int32),
    before: wp.array2d(dtype=wp.int32),
    after: wp.array2d(dtype=wp.int32),
):
    """Worlds that did not go on are as they were."""
    w, j = wp.tid()
    if going[w] == 0:
        after[w, j] = before[w, j]


@wp.kernel
def count_contacts(
    count: wp.array(dtype=wp.int32),
    room: int,
    worlds: wp.array(dtype=wp.int32),
    found: wp.array(dtype=wp.int32),
):
    """How many contacts each world has."""
    c = wp.tid()
    if c < wp.min(count[0], room):
        wp.atomic_add(found, worlds[c], 1)


@wp.kernel
def note_most(
    found: wp.array(dtype=wp.int32),
    contacts: wp.array(dtype=wp.int32),
    pairs: wp.array(dtype=wp.int32),
    room: int,
    most: wp.array(dtype=wp.int32),
    crowded: wp.array(dtype=wp.int32),
):
    """The most contacts so far of each world, and whether those of all worlds together lacked room."""
    w = wp.tid()
    most[w] = wp.max(most[w], found[w])
    found[w] = 0
    if contacts[0] > room or pairs[0] > room:
        crowded[w] = 1


@wp.kernel
def note_depth(
    count: wp.array(dtype=wp.int32),
    room: int,
    distance: wp.array(dtype=wp.float32),
    geoms: wp.array(dtype=wp.vec2i),
    worlds: wp.array(dtype=wp.int32),
    judged: wp.array(dtype=wp.int32),
    going: wp.array(dtype=wp.int32),
    deepest: wp.array(dtype=wp.float32),
):
    """The deepest overlap so far of each world that goes on, metres; the robot's base does not count."""
    c = wp.tid()
    if c >= wp.min(count[0], room):
        return
    w, pair = worlds[c], geoms[c]
    if going[w] != 0 and judged[pair[0]] != 0 and judged[pair[1]] != 0 and -distance[c] > deepest[w]:
        wp.atomic_max(deepest, w, -distance[c])


@wp.kernel
def note_deepest_pair(
    count: wp.array(dtype=wp.int32),
    room: int,
    distance: wp.array(dtype=wp.float32),
    geoms: wp.array(dtype=wp.vec2i),
    worlds: wp.array(dtype=wp.int32),
    judged: wp.array(dtype=wp.int32),
    going: wp.array(dtype=wp.int32),
    deepest: wp.array(dtype=wp.float32),
    deepest_pair: wp.array(dtype=wp.vec2i),
):
    """Which two geoms overlap the deepest, once `note_depth` has said how deep."""
    c = wp.tid()
    if c >= wp.min(count[0], room):
        return
    w, pair = worlds[c], geoms[c]
    if going[w] != 0 and judged[pair[0]] != 0 and judged[pair[1]] != 0 and -distance[c] == deepest[w]:
        deepest_pair[w] = pair


@wp.kernel
def add_forces(
    count: wp.array(dtype=wp.int32),
    room: int,
    frames: wp.array(dtype=wp.mat33),
    geoms: wp.array(dtype=wp.vec2i),
    worlds: wp.array(dtype=wp.int32),
    address: wp.array2d(dtype=wp.int32),
    forces: wp.array2d(dtype=wp.float32),
    link: wp.array(dtype=wp.int32),
    tip: wp.array(dtype=wp.int32),
    thing: wp.array(dtype=wp.int32),
    n_things: int,
    tips: wp.array2d(dtype=wp.vec3),
    by_link: wp.array2d(dtype=wp.vec3),
):
    """Add the forces of contacts to those on fingertips, and to those of each link on each object.

    With elliptic cones the solver's forces are those along the axes of the contact's frame; its first axis
    points from the first geom to the second.
    """
    c = wp.tid()
    if c >= wp.min(count[0], room):
        return
    at = address[c, 0]
    if at < 0 or at >= forces.shape[1]:
        return
    pair = geoms[c]
    a, b = pair[0], pair[1]
    if link[a] < 0 and link[b] < 0:
        return
    w = worlds[c]
    along = wp.vec3(forces[w, at], forces[w, address[c, 1]], forces[w, address[c, 2]])
    force = wp.transpose(frames[c]) * along
    if tip[a] >= 0:
        wp.atomic_sub(tips, w, tip[a], force)
    if tip[b] >= 0:
        wp.atomic_add(tips, w, tip[b], force)
    if thing[a] >= 0 and link[b] >= 0:
        wp.atomic_sub(by_link, w, link[b] * n_things + thing[a], force)
    if thing[b] >= 0 and link[a] >= 0:
        wp.atomic_add(by_link, w, link[a] * n_things + thing[b], force)


@wp.kernel
def add_hand_forces(
    n_links: int,
    n_things: int,
    by_link: wp.array2d(dtype=wp.vec3),
    hand: wp.array2d(dtype=wp.float32),
):
    """Add the magnitudes of all links' forces on each object, and forget the forces."""
    w, k = wp.tid()
    total = float(0.0)  # noqa: UP018  # 0.0 alone would be a constant
    for i in range(n_links):
        total += wp.length(by_link[w, i * n_things + k])
        by_link[w, i * n_things + k] = wp.vec3(0.0, 0.0, 0.0)
    hand[w, k] = hand[w, k] + total


@wp.kernel
def feel_wrist(
    inner: wp.array2d(dtype=wp.spatial_vector),
    centre: wp.array2d(dtype=wp.vec3),
    position: wp.array2d(dtype=wp.vec3),
    rotation: wp.array2d(dtype=wp.quat),
    wrist: int,
    root: int,
    tool: int,
    sample: wp.array(dtype=wp.int32),
    felt: wp.array3d(dtype=wp.float32),
):
    """What the wrench at the wrist is computed from, see `mujoco_sensing.wrist_wrenches`."""
    w, k = wp.tid(), sample[0]
    for j in range(6):
        felt[w, k, j] = inner[w, wrist][j]
    for j in range(3):
        felt[w, k, 6 + j] = centre[w, root][j]
        felt[w, k, 9 + j] = position[w, tool][j]
    for j in range(4):
        felt[w, k, 12 + j] = rotation[w, tool][j]


@wp.kernel
def count_up(number: wp.array(dtype=wp.int32)):
    """One more."""
    number[0] = number[0] + 1


@wp.kernel
def find_near(
    count: wp.array(dtype=wp.int32),
    room: int,
    distance: wp.array(dtype=wp.float32),
    geoms: wp.array(dtype=wp.vec2i),
    worlds: wp.array(dtype=wp.int32),
    judged: wp.array(dtype=wp.int32),
    link: wp.array(dtype=wp.int32),
    thing: wp.array(dtype=wp.int32),
    body: wp.array(dtype=wp.int32),
    n_bodies: int,
    hand_distance: wp.array2d(dtype=wp.float32),
    support: wp.array2d(dtype=wp.float32),
):
    """How far objects are from the hand, and what they touch."""
    c = wp.tid()
    if c >= wp.min(count[0], room):
        return
    w, pair = worlds[c], geoms[c]
    if judged[pair[0]] == 0 or judged[pair[1]] == 0:
        return
    for side in range(2):
        me, other = pair[side], pair[1 - side]
        k = thing[me]
        if k >= 0 and link[other] >= 0:
            wp.atomic_min(hand_distance, w, k, wp.max(distance[c], 0.0))
        if k >= 0 and link[other] < 0:
            support[w, k * n_bodies + body[other]] = 1.0


@wp.kernel
def take_bodies(
    bodies: wp.array(dtype=wp.int32),
    position: wp.array2d(dtype=wp.vec3),
    rotation: wp.array2d(dtype=wp.quat),
    out: wp.array2d(dtype=wp.float32),
):
    """Poses of some bodies, seven numbers each."""
    w, k = wp.tid()
    for j in range(3):
        out[w, 7 * k + j] = position[w, bodies[k]][j]
    for j in range(4):
        out[w, 7 * k + 3 + j] = rotation[w, bodies[k]][j]


@wp.kernel
def pack(
    source: wp.array2d(dtype=wp.int32),
    first: int,
    report: wp.array2d(dtype=wp.int32),
):
    """Words of one array into columns of the report, which one transfer brings to the host."""
    w, j = wp.tid()
    report[w, first + j] = source[w, j]
