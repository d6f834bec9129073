"""The parameters of a scan: those of its steps, section by section."""

from schemas.base.model import Document
from schemas.parameters.extraction import ExtractionParameters
from schemas.parameters.fusion import FusionParameters
from schemas.parameters.heads import HeadParameters
from schemas.parameters.mapping import MappingParameters
from schemas.parameters.normals import NormalParameters
from schemas.parameters.outliers import OutlierParameters
from schemas.parameters.surface import SurfaceParameters


class ScanParameters(Document):
    """The parameters of all steps of a scan, one model a step."""

    extraction: ExtractionParameters = ExtractionParameters()
    mapping: MappingParameters = MappingParameters()
    heads: HeadParameters = HeadParameters()
    fusion: FusionParameters = FusionParameters()
    outliers: OutlierParameters = OutlierParameters()
    normals: NormalParameters = NormalParameters()
    surface: SurfaceParameters = SurfaceParameters()
