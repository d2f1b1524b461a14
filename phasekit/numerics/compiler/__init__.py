"""Translation of kernels into machine code: Python's syntax tree to LLVM's language."""
