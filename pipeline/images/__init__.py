"""Pictures: headers, EXIF, decoding."""
