"""Files of other programs at which their libraries crash, end in tracebacks, or never end."""

import gzip

import pytest

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.storage import apart

SVG = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">{}</svg>'
IFC = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('','',(''),(''),'','','');
FILE_SCHEMA(('IFC4'));
ENDSEC;
DATA;
#2=IFCAXIS2PLACEMENT3D(#3,$,$);
#3=IFCCARTESIANPOINT((0.,0.,0.));
{}
ENDSEC;
END-ISO-10303-21;
"""
WALL = """#5=IFCWALL('0000000000000000000002',$,'w',$,$,#1,#6,$,$);
#6=IFCPRODUCTDEFINITIONSHAPE($,$,(#7));
#8=IFCMAPPEDITEM(#9,#10);
#9=IFCREPRESENTATIONMAP(#2,#7);
#10=IFCCARTESIANTRANSFORMATIONOPERATOR3D($,$,#3,1.,$);
"""
MAPPED_BY_ITSELF = f"""{WALL}#1=IFCLOCALPLACEMENT($,#2);
#7=IFCSHAPEREPRESENTATION(#12,'Body','MappedRepresentation',(#8));
#12=IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-5,#2,$);
#13=IFCPROJECT('0000000000000000000009',$,'p',$,$,$,$,(#12),$);"""
PLACED_BY_ITSELF = f"""{WALL}#1=IFCLOCALPLACEMENT(#1,#2);
#4=IFCBUILDINGSTOREY('0000000000000000000001',$,'s',$,$,#1,$,$,.ELEMENT.,0.);
#7=IFCSHAPEREPRESENTATION($,'Body','MappedRepresentation',(#8));
#11=IFCRELCONTAINEDINSPATIALSTRUCTURE('0000000000000000000003',$,$,$,(#5),#4);"""
BULGE = """  0
SECTION
  2
ENTITIES
  0
LWPOLYLINE
100
AcDbEntity
  8
wall
100
AcDbPolyline
 90
3
 70
1
 10
0
 20
0
 42
1000000000.0
 10
1e+300
 20
0
 42
1000000000.0
 10
1e+300
 20
1e+300
 42
1000000000.0
  0
ENDSEC
  0
EOF
"""
GROUPS = "<g>" * 5000 + '<rect class="wall" width="9" height="9"/>' + "</g>" * 5000
CASES = {
    "06-selfmap.ifc": (IFC.format(MAPPED_BY_ITSELF), r"its reader died \(SIGSEGV\)"),
    "06-selfplace.ifc": (IFC.format(PLACED_BY_ITSELF), "its parts are nested too deeply"),
    "07-deep.svg": (SVG.format(GROUPS), "its parts are nested too deeply"),
    "07-useself.svg": (
        SVG.format('<g id="a" class="wall"><use xlink:href="#a"/></g>'),
        "its parts are nested too deeply",
    ),
    "12-bulgehuge.dxf": (BULGE, r"its reader failed \(ValueError at dxf\.py"),
}
PACKAGES = {".ifc": "ifcopenshell", ".svg": "svgelements", ".dxf": "ezdxf"}


@pytest.mark.parametrize("name", CASES)
def test_what_a_library_fails_at_is_an_error_of_one_line(tmp_path, name):
    content, message = CASES[name]
    path = tmp_path / name
    pytest.importorskip(PACKAGES[path.suffix])
    path.write_text(content, encoding="utf-8")

    with pytest.raises(FloorPlanError, match=message) as caught:
        load_floorplan(path)
    apart._stop()

    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    assert "export it again" in str(caught.value)


def test_packed_many_times_is_refused(tmp_path):
    """The reader looked into each of 2,398 layers within the other."""
    content = b"hello"
    for _ in range(2000):
        content = gzip.compress(content, 0)
    path = tmp_path / "03-nested-gzip.json"
    path.write_bytes(content)

    with pytest.raises(FloorPlanError, match=r"is a packed file \(gzip\), .* unpack it"):
        load_floorplan(path)
