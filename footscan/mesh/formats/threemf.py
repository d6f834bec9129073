"""3MF files: a model in XML within a zip file, which states its unit.

3MF Consortium, "3D Manufacturing Format, Core Specification" 1.3; for colours, "Materials and Properties Extension"
1.2.
"""

import io
import zipfile
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from footscan.mesh.formats.text import coordinates
from footscan.mesh.mesh import Mesh
from footscan.mesh.topology import edge_counts
from schemas.base.errors import one_line

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
MATERIAL = "http://schemas.microsoft.com/3dmanufacturing/material/2015/02"
MODEL = "3D/3dmodel.model"
CONTENT_TYPES = """\
<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
</Types>
"""
RELATIONS = f"""\
<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Id="model" Target="/{MODEL}" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>
"""


def threemf_of(mesh: Mesh) -> bytes:
    """Encode a 3MF file in mm, with colours if there are any; the same mesh gives the same bytes."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as package:
        for name, text in (("[Content_Types].xml", CONTENT_TYPES), ("_rels/.rels", RELATIONS), (MODEL, _model(mesh))):
            part = zipfile.ZipInfo(name)  # dated 1980 always
            part.create_system, part.compress_type = 0, zipfile.ZIP_DEFLATED
            package.writestr(part, text)
    return stream.getvalue()


def _model(mesh: Mesh) -> str:
    vertices = "\n".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in coordinates(mesh.vertices))
    colours, properties, coloured = "", [""] * len(mesh.faces), ""
    if mesh.colours is not None:
        colours, of_vertex = _colour_group(mesh.colours)
        coloured = ' pid="2" pindex="0"'
        properties = [f' pid="2" p1="{a}" p2="{b}" p3="{c}"' for a, b, c in of_vertex[mesh.faces].tolist()]
    triangles = "\n".join(
        f'<triangle v1="{a}" v2="{b}" v3="{c}"{extra}/>'
        for (a, b, c), extra in zip(mesh.faces.tolist(), properties, strict=True)
    )
    _, meeting = edge_counts(mesh.faces)
    kind = "model" if np.all(meeting == 2) else "surface"  # a "model" must be closed (core specification, 4.1)
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<model unit="millimeter" xml:lang="en-US" xmlns="{CORE}" '
        f'xmlns:m="{MATERIAL}" xmlns:footscan="urn:footscan:metadata">\n{_metadata(mesh)}<resources>\n{colours}'
        f'<object id="1" name="foot" type="{kind}"{coloured}><mesh>\n<vertices>\n{vertices}\n</vertices>\n'
        f"<triangles>\n{triangles}\n</triangles>\n</mesh></object>\n</resources>\n"
        '<build><item objectid="1"/></build>\n</model>\n'
    )


def _metadata(mesh: Mesh) -> str:
    """Metadata under the names of the specification, and under names of footscan."""
    standard = {"Title": " ".join(mesh.metadata.get(key, "") for key in ("patient", "scan", "side")).strip() or "foot"}
    if "software" in mesh.metadata:
        standard["Application"] = mesh.metadata["software"]
    own = {f"footscan:{key}": value for key, value in mesh.metadata.items()}
    return "".join(
        f"<metadata name={quoteattr(name)}>{escape(one_line(value))}</metadata>\n"
        for name, value in (standard | own).items()
    )


def _colour_group(
    colours: "np.ndarray[tuple[int, ...], np.dtype[np.uint8]]",
) -> tuple[str, "np.ndarray[tuple[int, ...], np.dtype[np.int64]]"]:
    """Returns the XML of the distinct colours, and (V,) the number of each vertex's colour."""
    codes, of_vertex = np.unique(colours.astype(np.int64) @ [65536, 256, 1], return_inverse=True)
    entries = "\n".join(f'<m:color color="#{code:06X}"/>' for code in codes.tolist())
    return f'<m:colorgroup id="2">\n{entries}\n</m:colorgroup>\n', of_vertex
