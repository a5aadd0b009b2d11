"""Pictures by matplotlib and Pillow, and the colours that all views share."""
