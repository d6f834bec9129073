import base64
import hashlib
import re

import numpy as np

from footscan.report.viewer import SCRIPT, SCRIPT_DIGEST, viewer


def test_the_mesh_is_on_the_page_centred_and_scaled_to_16_bits():
    vertices = np.array([[10, 10, 10], [16, 10, 10], [10, 18, 10]], float)
    page = viewer(vertices, np.array([[0, 1, 2]]), np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]], np.uint8))
    data = {name: base64.b64decode(text) for name, text in re.findall(r'data-(\w+)="([^"]*)"', page)}
    # About (13, 14, 10) the corners lie at (-3, -4), (3, -4), (-3, 4), each 5 mm off, which 32767 stands for.
    x, y = round(32767 * 3 / 5), round(32767 * 4 / 5)
    assert np.frombuffer(data["points"], "<i2").tolist() == [-x, -y, 0, x, -y, 0, -x, y, 0]
    assert np.frombuffer(data["faces"], "<u2").tolist() == [0, 1, 2]
    assert np.frombuffer(data["colours"], "u1").tolist() == [1, 2, 3, 4, 5, 6, 7, 8, 9]


def test_the_digest_is_the_scripts():
    digest = base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode()
    assert f"sha256-{digest}" == SCRIPT_DIGEST
    assert "</" not in SCRIPT
