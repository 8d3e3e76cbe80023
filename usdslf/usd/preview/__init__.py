"""What other surface models show, as UsdPreviewSurface."""
