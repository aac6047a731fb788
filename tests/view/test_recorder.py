import meshcat.geometry as shapes
import meshcat.transformations as tf
import psutil
import umsgpack

from kickdyn.view.recorder import recorder


def kinds(viewer):
    said = [umsgpack.unpackb(packed) for packed in viewer.window.commands()]
    return [(command["type"], command["path"], command.get("property")) for command in said]


def test_no_socket_and_no_child():
    process = psutil.Process()
    sockets, children = process.net_connections("all"), process.children()
    viewer = recorder()
    viewer["ball"].set_object(shapes.Sphere(0.1))
    viewer.static_html()
    assert process.net_connections("all") == sockets
    assert process.children() == children


def test_keeps_what_a_browser_needs_in_order():
    viewer = recorder()
    viewer["a"].set_object(shapes.Sphere(0.1))
    viewer["a"].set_transform(tf.translation_matrix((1, 0, 0)))
    viewer["a"].set_property("visible", True)
    viewer["a"].set_property("color", [1, 0, 0, 1])
    assert kinds(viewer) == [
        ("set_object", "/meshcat/a", None),
        ("set_transform", "/meshcat/a", None),
        ("set_property", "/meshcat/a", "visible"),
        ("set_property", "/meshcat/a", "color"),
    ]


def test_the_latest_replaces_and_comes_last():
    viewer = recorder()
    viewer["a"].set_transform(tf.translation_matrix((1, 0, 0)))
    viewer["b"].set_property("visible", True)
    viewer["a"].set_transform(tf.translation_matrix((2, 0, 0)))
    last = [umsgpack.unpackb(packed) for packed in viewer.window.commands()]
    assert [command["path"] for command in last] == ["/meshcat/b", "/meshcat/a"]
    assert last[1]["matrix"][12] == 2


def test_delete_forgets_the_node_and_what_is_below():
    viewer = recorder()
    for name in ("a", "a/b", "ab"):
        viewer[name].set_object(shapes.Sphere(0.1))
    viewer["a"].delete()
    assert [path for _, path, _ in kinds(viewer)] == ["/meshcat/ab"]


def test_static_html_is_a_page(commands_of):
    viewer = recorder()
    viewer["a"].set_object(shapes.Sphere(0.1))
    assert [command["path"] for command in commands_of(viewer.static_html())] == ["/meshcat/a"]


def test_a_listener_hears_every_command():
    viewer, heard = recorder(), []
    viewer.window.listener = heard.append
    viewer["a"].set_object(shapes.Sphere(0.1))
    viewer["a"].delete()
    assert [umsgpack.unpackb(packed)["type"] for packed in heard] == ["set_object", "delete"]
