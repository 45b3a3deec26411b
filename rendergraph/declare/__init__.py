"""What a node declares: ports and parameters. The one source for checking, schema, docs, uniforms and diffs."""

from __future__ import annotations

from rendergraph.declare.extensions import NO_EXTENSIONS as NO_EXTENSIONS
from rendergraph.declare.extensions import READ_IMAGES as READ_IMAGES
from rendergraph.declare.extensions import Added as Added
from rendergraph.declare.extensions import Extension as Extension
from rendergraph.declare.extensions import Extensions as Extensions
from rendergraph.declare.extensions import MeshData as MeshData
from rendergraph.declare.extensions import Source as Source
from rendergraph.declare.extensions import extension_mistakes as extension_mistakes
from rendergraph.declare.mistakes import RESERVED_NAMES as RESERVED_NAMES
from rendergraph.declare.mistakes import declaration_mistakes as declaration_mistakes
from rendergraph.declare.node import DROPPED as DROPPED
from rendergraph.declare.node import Node as Node
from rendergraph.declare.parameters import Parameter as Parameter
from rendergraph.declare.parameters import define as define
from rendergraph.declare.parameters import param as param
from rendergraph.declare.parameters import structural as structural
from rendergraph.declare.scene_keys import Image as Image
from rendergraph.declare.scene_keys import SceneKey as SceneKey
from rendergraph.declare.scene_keys import Section as Section
from rendergraph.facts import CameraFacts as CameraFacts
from rendergraph.facts import Facts as Facts
from rendergraph.facts import LightFacts as LightFacts
from rendergraph.facts import MaterialFacts as MaterialFacts
from rendergraph.facts import ObjectFacts as ObjectFacts
from rendergraph.facts import TextureInfo as TextureInfo
from rendergraph.facts import casting_lights as casting_lights
from rendergraph.ports import Function as Function
from rendergraph.ports import History as History
from rendergraph.ports import InOut as InOut
from rendergraph.ports import Input as Input
from rendergraph.ports import Internal as Internal
from rendergraph.ports import Output as Output
from rendergraph.ports import Part as Part
from rendergraph.ports import Port as Port
from rendergraph.ports import Ruled as Ruled
from rendergraph.ports import SizeRule as SizeRule
from rendergraph.ports import Texel as Texel
from rendergraph.ports import Views as Views
from rendergraph.ports import WrittenPort as WrittenPort
