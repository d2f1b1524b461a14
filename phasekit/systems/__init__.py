"""Systems: values on a law, one file each."""
