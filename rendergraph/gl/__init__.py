"""All of OpenGL: moderngl for context, programs, draws and queries; raw calls for what it lacks."""
