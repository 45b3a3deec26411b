"""Compile a plan into programs, framebuffers and a flat list of calls; a frame only executes this list."""

from __future__ import annotations

from rendergraph.compile.executable import Executable
from rendergraph.compile.gpu_scene import GpuScene
from rendergraph.compile.kept import KeptValues
from rendergraph.compile.memory import TexturePool
from rendergraph.compile.programs import ProgramCache
from rendergraph.compile.steps import compile_plan
from rendergraph.compile.transfers import SCENE_CHANGES
