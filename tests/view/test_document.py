import re
import subprocess
import sys

from kickdyn.view.document import live_document, static_document


def test_needs_nothing_from_elsewhere():
    html = static_document([b"\x00"], title="t")
    assert not re.findall(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", html)
    assert not re.findall(r"<(?:link|iframe|img)\b|@import|<script[^>]+src", html)
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', html)[1]
    assert policy.startswith("default-src 'none'")
    assert "connect-src 'none'" in policy
    assert "http" not in policy


def test_title_is_escaped():
    html = static_document([], title="</title><script>alert(1)</script>")
    assert "alert(1)</script>" not in html
    assert "<title>&lt;/title&gt;&lt;script&gt;alert(1)" in html


def test_live_page_asks_its_own_server_only():
    html = live_document("/scene", title="t")
    assert 'viewer.connect("ws://" + location.host + "/scene")' in html
    assert "connect-src ws://127.0.0.1:* ws://localhost:*" in html


def test_importing_kickdyn_leaves_meshcat_alone():
    heavy = "{'meshcat', 'yourdfpy', 'trimesh', 'tornado'}"
    code = f"import sys, kickdyn; print({heavy} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
