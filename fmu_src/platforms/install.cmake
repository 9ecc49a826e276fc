# What a package carries when the libraries of all platforms have been made: nothing is compiled then.
set(native mixed_order_game/_native)
install(DIRECTORY ${MIXED_ORDER_GAME_PLATFORMS}/binaries/ DESTINATION ${native}/binaries)
install(DIRECTORY ${MIXED_ORDER_GAME_PLATFORMS}/tools/ DESTINATION ${native}/tools USE_SOURCE_PERMISSIONS)
install(DIRECTORY ${MIXED_ORDER_GAME_PLATFORMS}/licenses/ DESTINATION ${native}/licenses)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/modelDescription/documentation/ DESTINATION ${native}/documentation)
install(FILES ${PROJECT_SOURCE_DIR}/modelDescription/model.png DESTINATION ${native})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/modelDescription/games/ DESTINATION mixed_order_game/games)
