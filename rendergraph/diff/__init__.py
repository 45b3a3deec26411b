"""The differences between two graphs: as a value, as text, as JSON and as a picture. Needs no GL."""

from rendergraph.diff.show import diff_json as diff_json
from rendergraph.diff.show import diff_svg as diff_svg
from rendergraph.diff.show import diff_text as diff_text
from rendergraph.diff.structure import GraphDiff as GraphDiff
from rendergraph.diff.structure import LinkChange as LinkChange
from rendergraph.diff.structure import OutputChange as OutputChange
from rendergraph.diff.structure import ParameterChange as ParameterChange
from rendergraph.diff.structure import PlanFigures as PlanFigures
from rendergraph.diff.structure import Retyped as Retyped
from rendergraph.diff.structure import diff as diff
from rendergraph.diff.structure import figures as figures
