"""What is subclassed of Mitsuba, which checks must not need; the rest is `Any`."""

from typing import Any

class BSDF:
    m_components: list[Any]
    m_flags: Any
    def __init__(self, props: Any) -> None: ...

class Emitter:
    m_flags: Any
    def __init__(self, props: Any) -> None: ...
    def get_shape(self) -> Any: ...

def __getattr__(name: str) -> Any: ...
