"""usdview: the plugin that opens the painting window from usdview's menu.

    plugInfo.json   what USD's plugin registry reads: put this folder on PXR_PLUGINPATH_NAME
    container       the plugin container, and what its command does
"""
